"""Plants: trees, conifers, bushes and hedges. Crowns are solid clusters under loose leaves, so depth is defined.

A plant stands on z = 0 about the origin of a frame of its own; ``avenue``, ``grove`` and ``wood_line`` place many in
the world. Metres.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_generator.mesh.places.shapes import boulder, gridded_box, leaves, roughened, standing_box, tube, turned
from fedora_generator.mesh.places.surface import Floats, Group, Surface, joined, painted, solid, together, unit

GOLDEN_ANGLE_RAD: Final = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True, slots=True)
class Foliage:
    """Materials of a crown: its solid clusters, and the loose leaves on them."""

    cluster: str
    leaf: str


GREEN: Final = Foliage("leaves", "leaf")
DEEP: Final = Foliage("deep leaves", "deep leaf")
AUTUMN: Final = Foliage("autumn leaves", "autumn leaf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tree:
    """A broad-leaved tree: position in the world, height, radius of the crown, metres, and its foliage."""

    x_m: float
    y_m: float
    height_m: float
    crown_radius_m: float
    foliage: Foliage


def broadleaf(
    rng: np.random.Generator, height_m: float, crown_radius_m: float, foliage: Foliage = GREEN, *, clusters: int = 12
) -> Group:
    """Build a tree with a bent trunk, branches and a crown of clusters; it stands on the origin."""
    crown_z_m = height_m - 0.95 * crown_radius_m
    bend_m = rng.normal(0, 0.05 * crown_z_m, 2)
    rise = np.array([-0.05, 0.06, 0.3, 0.65, 1.0])
    trunk_m = np.stack([bend_m[0] * rise**2, bend_m[1] * rise**2, crown_z_m * rise], axis=-1)
    foot_m = 0.035 * height_m
    trunk = tube(trunk_m, foot_m * np.array([1.5, 1.05, 0.85, 0.7, 0.45]), sides=10)

    # Centres of the clusters in a unit ball: the first near the top, the others downwards in steps of the golden angle.
    heights = np.linspace(0.75, -0.75, clusters - 1)
    turns_rad = GOLDEN_ANGLE_RAD * np.arange(clusters - 1) + rng.uniform(0, 2 * math.pi)
    reach = np.sqrt(1 - (0.8 * heights) ** 2) * rng.uniform(0.8, 1.05, clusters - 1)
    around = np.stack([reach * np.cos(turns_rad), reach * np.sin(turns_rad), heights], axis=-1)
    in_crown = np.concatenate([[[0.0, 0.0, 0.5]], around])
    centers_m = trunk_m[-1] + in_crown * crown_radius_m * (0.62, 0.62, 0.5)

    branches = []
    fork_m = 0.45 * trunk_m[2] + 0.55 * trunk_m[3]
    for center_m in centers_m[1:]:
        middle_m = 0.5 * (fork_m + center_m) - (0.0, 0.0, 0.06 * float(np.linalg.norm(center_m - fork_m)))
        branch_m = np.stack([fork_m, middle_m, center_m])
        branches.append(tube(branch_m, foot_m * np.array([0.42, 0.32, 0.2]), sides=6))
    balls = [boulder(_ball_radii(rng, crown_radius_m), rng, 0.34) for _ in centers_m]
    crown = [_shifted(ball, center_m) for ball, center_m in zip(balls, centers_m, strict=True)]
    top_x_m, top_y_m, top_z_m = trunk_m[-1].tolist()
    crown_size_m = (2.1 * crown_radius_m, 2.1 * crown_radius_m, 2.0 * crown_radius_m)
    return (
        painted("bark", trunk, *branches)
        + painted(foliage.cluster, *crown)
        + painted(foliage.leaf, _loose_leaves(rng, joined(crown), 110 * clusters))
        + solid("trunk", (2.6 * foot_m, 2.6 * foot_m, top_z_m), (0, 0, 0.5 * top_z_m))
        + solid("crown", crown_size_m, (top_x_m, top_y_m, top_z_m))
    )


def avenue(rng: np.random.Generator, trees: Sequence[Tree]) -> Group:
    """Build broad-leaved trees of given sizes, each at its position in the world."""
    return together(
        broadleaf(rng, tree.height_m, tree.crown_radius_m, tree.foliage, clusters=12).at(tree.x_m, tree.y_m)
        for tree in trees
    )


def conifer(rng: np.random.Generator, height_m: float, radius_m: float) -> Group:
    """Build a spruce: a trunk and skirts of branches, each smaller than the one below."""
    trunk = tube([(0, 0, -0.1), (0, 0, 0.3 * height_m)], [0.03 * height_m, 0.025 * height_m], sides=8)
    skirts = []
    for share in np.linspace(0.0, 0.8, 6):
        low_m, reach_m = (0.1 + 0.9 * share) * height_m, radius_m * (1.04 - share)
        top_m = min(low_m + 0.34 * height_m, height_m)
        profile = [(0.0, low_m + 0.12 * reach_m), (reach_m, low_m), (0.0, top_m)]
        skirts.append(roughened(turned(profile, sides=14), 0.1 * reach_m, 0.6 * reach_m, rng))
    size_m = (1.3 * radius_m, 1.3 * radius_m, height_m)
    return painted("bark", trunk) + painted("deep leaves", *skirts) + solid("conifer", size_m, (0, 0, 0.5 * height_m))


def bush(rng: np.random.Generator, radius_m: float, foliage: Foliage = DEEP) -> Group:
    """Build a low bush of three clusters that sit in the ground."""
    places = [rng.uniform(-0.5, 0.5, 2) * radius_m for _ in range(3)]
    balls = [boulder(_ball_radii(rng, 1.5 * radius_m), rng, 0.25, cells=5) for _ in places]
    lifted = [_shifted(ball, (x, y, 0.35 * radius_m)) for ball, (x, y) in zip(balls, places, strict=True)]
    size_m = (2 * radius_m, 2 * radius_m, 1.6 * radius_m)
    return (
        painted(foliage.cluster, *lifted)
        + painted(foliage.leaf, _loose_leaves(rng, joined(lifted), 110))
        + solid("bush", size_m, (0, 0, 0.5 * size_m[2]))
    )


def hedge(rng: np.random.Generator, length_m: float, width_m: float = 0.7, height_m: float = 1.1) -> Group:
    """Build a clipped hedge along x about the origin."""
    size_m = (length_m, width_m, height_m)
    body = roughened(gridded_box(size_m, 0.22), 0.035, 0.5, rng)
    return (
        painted("deep leaves", body)
        + painted("deep leaf", _loose_leaves(rng, body, round(26 * length_m), length_m=0.11))
        + solid("hedge", size_m, (0, 0, 0.5 * height_m))
    )


def flower_bed(rng: np.random.Generator, length_m: float, width_m: float) -> Group:
    """Build a low cushion of flowers within a stone kerb, along x about the origin."""
    count = round(length_m / (0.55 * width_m))
    xs = (np.arange(count) + 0.5) * length_m / count - 0.5 * length_m
    tufts = [
        _shifted(boulder((0.46 * width_m, 0.42 * width_m, 0.3), rng, 0.3, cells=5), (x, rng.uniform(-0.05, 0.05), 0.08))
        for x in xs.tolist()
    ]
    kerbs = [
        standing_box((length_m + 0.24, 0.12, 0.2), y_m=0.5 * side * (width_m + 0.12), z_m=-0.08) for side in (-1, 1)
    ]
    ends = [standing_box((0.12, width_m, 0.19), x_m=0.5 * side * (length_m + 0.12), z_m=-0.08) for side in (-1, 1)]
    return (
        painted("flowers", *tufts)
        + painted("stone", *kerbs, *ends)
        + solid("flower bed", (length_m + 0.3, width_m + 0.3, 0.5), (0, 0, 0.25))
    )


def grove(rng: np.random.Generator, spots_m: Sequence[tuple[float, float]]) -> Group:
    """Build trees of random sizes at spots of x and y in the world: spruces among broad-leaved trees."""
    trees = [
        conifer(rng, rng.uniform(7.0, 11.0), rng.uniform(1.8, 2.6))
        if i % 3 == 1
        else broadleaf(rng, rng.uniform(6.5, 10.0), rng.uniform(2.2, 3.1), DEEP if i % 2 else GREEN, clusters=8)
        for i in range(len(spots_m))
    ]
    return together(tree.at(x_m, y_m) for tree, (x_m, y_m) in zip(trees, spots_m, strict=True))


def wood_line(
    rng: np.random.Generator, count: int, radius_m: tuple[float, float], height_m: tuple[float, float]
) -> Group:
    """Build trees far away, all around: rounded crowns that stand in the ground, dense enough to close the view.

    Parameters
    ----------
    rng
        Draws bearings, distances and sizes.
    count
        Number of trees.
    radius_m
        Least and largest distance from the origin of the world.
    height_m
        Least and largest height.
    """
    crowns = []
    for bearing_rad in 2 * math.pi * (np.arange(count) + rng.uniform(-0.4, 0.4, count)) / count:
        away_m, tall_m = rng.uniform(*radius_m), rng.uniform(*height_m)
        wide_m = rng.uniform(0.36, 0.6) * tall_m
        ball = boulder((wide_m, wide_m, 0.55 * tall_m), rng, 0.25, cells=4)
        position_m = (away_m * math.cos(bearing_rad), away_m * math.sin(bearing_rad), 0.48 * tall_m)
        crowns.append(_shifted(ball, position_m))
    return together([painted("far trees", joined(crowns))])


def _ball_radii(rng: np.random.Generator, crown_radius_m: float) -> Floats:
    return crown_radius_m * rng.uniform(0.32, 0.52) * np.array([1.0, 1.0, rng.uniform(0.75, 0.92)])


def _loose_leaves(rng: np.random.Generator, body: Surface, count: int, length_m: float = 0.24) -> Surface:
    """Leaves just above random points of a surface."""
    chosen = rng.integers(0, len(body.triangles), count)
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)[..., None]
    points = np.sum(body.vertices_m[body.triangles[chosen]] * weights, axis=1)
    normals = unit(np.sum(body.normals[body.triangles[chosen]] * weights, axis=1))
    above_m = length_m * rng.uniform(0.0, 0.5, (count, 1))
    return leaves(points + above_m * normals, normals, length_m, 0.5 * length_m, rng)


def _shifted(surface: Surface, shift_m: Floats | tuple[float, float, float]) -> Surface:
    shifted_m = surface.vertices_m + np.asarray(shift_m)
    return Surface(shifted_m, surface.normals, surface.triangles, surface.uv_m)
