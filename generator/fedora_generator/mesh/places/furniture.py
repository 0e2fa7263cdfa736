"""Objects of parks and streets: benches, lamp posts, bins, tables, railings, a fountain.

Each stands on z = 0 about the origin of a frame of its own; metres.
"""

from typing import Final

import numpy as np

from fedora_generator.mesh.places.group import Group, painted, solid
from fedora_generator.mesh.places.shapes import Point, cylinder, standing_box, turned
from fedora_generator.mesh.places.surface import moved
from fedora_generator.surfaces.world import Lamp

LAMP_HEIGHT_M: Final = 3.9


def bench(_: np.random.Generator) -> Group:
    """Build a bench of planks on two iron frames, 1.8 m long along x; who sits on it looks to -y."""
    seat = [standing_box((1.8, 0.10, 0.04), y_m=y, z_m=0.42) for y in (-0.24, -0.12, 0.0, 0.12)]
    back = [standing_box((1.8, 0.04, 0.11), y_m=0.22 + 0.03 * i, z_m=0.52 + 0.14 * i) for i in range(3)]
    legs = [standing_box((0.07, 0.07, 0.47), x_m=x, y_m=y, z_m=-0.05) for x in (-0.7, 0.7) for y in (-0.2, 0.14)]
    posts = [standing_box((0.06, 0.06, 0.56), x_m=x, y_m=0.325, z_m=0.38) for x in (-0.7, 0.7)]
    rests = [standing_box((0.085, 0.62, 0.05), x_m=x, y_m=0.05, z_m=0.365) for x in (-0.7, 0.7)]
    return (
        painted("wood", *seat, *back)
        + painted("metal", *legs, *posts, *rests)
        + solid("bench", (1.8, 0.8, 0.95), (0, 0.05, 0.47))
    )


def lamp_post(_: np.random.Generator, strength: float = 7.0) -> Group:
    """Build a street lamp with a lantern under a hat; ``strength`` as in ``Lamp``."""
    pole = turned(
        [
            (0.0, -0.05),
            (0.17, -0.05),
            (0.17, 0.25),
            (0.07, 0.42),
            (0.055, LAMP_HEIGHT_M - 0.2),
            (0.0, LAMP_HEIGHT_M - 0.2),
        ]
    )
    cup = turned([(0.0, -0.24), (0.10, -0.24), (0.15, -0.18), (0.0, -0.18)])
    lantern = turned([(0.0, -0.2), (0.14, -0.2), (0.22, 0.22), (0.0, 0.22)], sides=8)
    hat = turned([(0.0, 0.2), (0.29, 0.2), (0.10, 0.38), (0.0, 0.42)], sides=8)
    head = (painted("metal", cup, hat) + painted("lamp glass", lantern)).at(0, 0, LAMP_HEIGHT_M)
    lamp = Group(lamps=(Lamp(position_m=(0.0, 0.0, LAMP_HEIGHT_M), strength=strength),))
    return painted("metal", pole) + head + lamp + solid("lamp post", (0.5, 0.5, 4.4), (0, 0, 2.2))


def litter_bin(_: np.random.Generator) -> Group:
    """Build a slatted bin with a rim."""
    slats = [moved(standing_box((0.09, 0.03, 0.62), y_m=-0.24, z_m=0.06), yaw_deg=30.0 * i) for i in range(12)]
    rim = turned([(0.18, 0.66), (0.29, 0.66), (0.29, 0.74), (0.18, 0.74), (0.18, 0.66)])
    return (
        painted("wood", *slats)
        + painted("metal", cylinder(0.22, 0.64), rim)
        + solid("bin", (0.6, 0.6, 0.8), (0, 0, 0.4))
    )


def picket_fence(_: np.random.Generator, length_m: float) -> Group:
    """Build a white fence along x about the origin: posts, two rails, and pickets as broad as the gaps."""
    count = round(length_m / 0.26)
    xs = (np.arange(count) + 0.5) * length_m / count - 0.5 * length_m
    pickets = [standing_box((0.13, 0.03, 0.92), x_m=x, y_m=-0.04, z_m=0.08) for x in xs.tolist()]
    rails = [standing_box((length_m, 0.05, 0.09), z_m=z) for z in (0.28, 0.72)]
    ends = np.linspace(-0.5 * length_m + 0.1, 0.5 * length_m - 0.1, max(2, round(length_m / 2.6) + 1))
    posts = [standing_box((0.12, 0.12, 1.15), x_m=x, y_m=0.07, z_m=-0.05) for x in ends.tolist()]
    return painted("white paint", *pickets, *rails, *posts) + solid("fence", (length_m, 0.3, 1.1), (0, 0, 0.55))


def round_table(_: np.random.Generator) -> Group:
    """Build a round table on one foot, 0.9 m wide and 0.76 m high."""
    top = turned([(0, 0.7), (0.45, 0.7), (0.45, 0.76), (0, 0.76)])
    foot = turned([(0, -0.02), (0.28, -0.02), (0.28, 0.05), (0.06, 0.09), (0.06, 0.72), (0, 0.72)])
    return painted("wood", top) + painted("metal", foot)


def block(_: np.random.Generator, material: str, size_m: Point, foot_m: Point) -> Group:
    """Build a box of ``size_m`` along x, y and z; the middle of its bottom is at ``foot_m``."""
    return painted(material, standing_box(size_m, *foot_m))


def railing(length_m: float) -> Group:
    """Steel posts of 1 m with three bars, along x about the origin."""
    xs = np.linspace(-0.5 * length_m, 0.5 * length_m, max(2, round(length_m / 1.8) + 1))
    posts = [standing_box((0.08, 0.08, 1.0), x_m=x) for x in xs.tolist()]
    bars = [standing_box((length_m, 0.06, 0.06), y_m=-0.02, z_m=z) for z in (0.35, 0.64, 0.93)]
    return painted("steel", *posts, *bars)


def fountain(_: np.random.Generator, radius_m: float) -> Group:
    """Build a round basin of an outer radius with water in it and two bowls on a pillar."""
    r = radius_m
    rim = [(r, 0.42), (r + 0.1, 0.42), (r + 0.1, 0.55), (r - 0.35, 0.55), (r - 0.35, 0.42), (r - 0.3, 0.42)]
    wall = turned([(r - 0.3, -0.1), (r, -0.1), *rim, (r - 0.3, -0.1)], sides=40)
    pillar = turned([(0.0, 0.2), (0.42, 0.2), (0.30, 0.5), (0.17, 0.8), (0.17, 1.5), (0.24, 1.6), (0.0, 1.6)], sides=16)
    bowl = turned(
        [(0.0, 1.2), (0.25, 1.2), (1.05, 1.5), (1.12, 1.62), (1.0, 1.62), (0.24, 1.42), (0.0, 1.42)], sides=28
    )
    top = turned(
        [(0.0, 1.55), (0.12, 1.55), (0.12, 2.0), (0.5, 2.2), (0.52, 2.28), (0.1, 2.2), (0.1, 2.5), (0.0, 2.62)], 20
    )
    water = turned([(r - 0.1, 0.36), (0.0, 0.36)], sides=40)
    return (
        painted("stone", wall, pillar, bowl, top)
        + painted("water", water)
        + solid("fountain", (2 * r + 0.2, 2 * r + 0.2, 0.6), (0, 0, 0.3))
        + solid("bowls", (2.3, 2.3, 2.7), (0, 0, 1.35))
    )
