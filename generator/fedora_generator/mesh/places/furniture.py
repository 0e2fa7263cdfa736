"""Objects of parks and streets, and of a racetrack: gates, gantry, tyre walls, kerbs, boards, floodlights and more.

Each stands on z = 0 about the origin of a frame of its own; metres.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from fedora_generator.mesh.places.shapes import Point, box, cylinder, height_field, prism, standing_box, tube, turned
from fedora_generator.mesh.places.surface import Group, fan, joined, moved, painted, solid, together
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


GATE_OPENING_M: Final = 2.3
"""Inner width and height of a gate."""

GATE_CENTER_M: Final = 1.6
"""Height of its middle."""


def gate(_: np.random.Generator, colour: str) -> Group:
    """Build a square frame across x to fly through, with a strip of light around its inside.

    ``colour`` names the materials of both: ``orange panel`` and ``orange light``.
    """
    inner, wide, thick = GATE_OPENING_M, 0.42, 0.16
    reach = 0.5 * (inner + wide)
    low, high = GATE_CENTER_M - reach, GATE_CENTER_M + reach
    upright = (thick, wide, inner + 2 * wide)
    sides = [box(upright, (0, side * reach, GATE_CENTER_M)) for side in (-1, 1)]
    beams = [box((thick, inner, wide), (0, 0, z)) for z in (low, high)]
    strips = [box((0.06, 0.06, inner), (0, side * (0.5 * inner - 0.03), GATE_CENTER_M)) for side in (-1, 1)]
    strips += [box((0.06, inner - 0.12, 0.06), (0, 0, GATE_CENTER_M + z * (0.5 * inner - 0.03))) for z in (-1, 1)]
    feet = [standing_box((1.1, 0.5, 0.12), y_m=side * reach, z_m=-0.04) for side in (-1, 1)]
    solids = [solid("gate post", (0.3, wide, inner + 2 * wide), (0, side * reach, GATE_CENTER_M)) for side in (-1, 1)]
    solids += [solid("gate beam", (0.3, inner, wide), (0, 0, z)) for z in (low, high)]
    return (
        painted(f"{colour} panel", *sides, *beams)
        + painted(f"{colour} light", *strips)
        + painted("metal", *feet)
        + together(solids)
    )


def gantry(_: np.random.Generator, half_width_m: float, height_m: float) -> Group:
    """Build the start: a board over the track on two towers, with five red lights below it."""
    feet_m = [(x, y * half_width_m + d) for x in (-0.4, 0.4) for y in (-1, 1) for d in (-0.4, 0.4)]
    towers = [standing_box((0.16, 0.16, height_m + 1.3), x, y, -0.1) for x, y in feet_m]
    rungs = [
        box((0.7, 0.9, 0.09), (0, y * half_width_m, z)) for y in (-1, 1) for z in np.arange(0.4, height_m + 1, 0.8)
    ]
    beam = box((0.7, 2 * half_width_m - 0.6, 0.3), (0, 0, height_m - 0.1))
    board = box((0.5, 9.6, 1.2), (0, 0, height_m + 0.65))
    lamps = [box((0.24, 0.34, 0.34), (-0.4, y, height_m - 0.5)) for y in np.linspace(-1.6, 1.6, 5).tolist()]
    hood = box((0.2, 4.2, 0.5), (-0.25, 0, height_m - 0.5))
    posts = [solid("gantry", (1.1, 1.1, 7.0), (0, y * half_width_m, 3.5)) for y in (-1, 1)]
    over = solid("gantry board", (1.1, 2 * half_width_m, 2.4), (0, 0, height_m + 0.4))
    return (
        painted("steel", *towers, *rungs, beam)
        + painted("start board", board)
        + painted("metal", hood)
        + painted("red light", *lamps)
        + together([*posts, over])
    )


def arch(_: np.random.Generator, radius_m: float, thickness_m: float) -> Group:
    """Build an inflated arch over the track."""
    angles = np.linspace(-0.12, math.pi + 0.12, 25)
    points = np.stack([np.zeros_like(angles), radius_m * np.cos(angles), 0.9 * radius_m * np.sin(angles)], axis=-1)
    hoop = tube(points, np.full(len(points), thickness_m), sides=14)
    size_m = (2 * thickness_m, 2.2, 6.0)
    sides = [solid("arch", size_m, (0, side * (radius_m - 0.5), 3.0)) for side in (-1, 1)]
    over = solid("arch", (size_m[0], 2 * radius_m, 3.0), (0, 0, 5.6))
    return painted("arch cloth", hoop) + together([*sides, over])


def tyre_wall(_: np.random.Generator, length_m: float, tyres: int = 4) -> Group:
    """Build stacks of ``tyres`` along x about the origin, every few of them painted."""
    count = round(length_m / 0.62)
    xs = (np.arange(count) + 0.5) * length_m / count - 0.5 * length_m
    ring = [(0.22, 0.0), (0.29, 0.05), (0.31, 0.11), (0.29, 0.17)]
    profile = [
        (0.0, 0.0),
        *((r, z + 0.22 * i - 0.02) for i in range(tyres) for r, z in ring),
        (0.0, 0.22 * tyres - 0.02),
    ]
    stack = turned(profile, sides=10)
    colours = ("tyre", "tyre", "white tyre", "tyre", "tyre", "red tyre")
    stacks = [painted(colours[i // 2 % len(colours)], moved(stack, (x, 0.0, 0.0))) for i, x in enumerate(xs.tolist())]
    return together(stacks) + solid("tyre wall", (length_m, 0.7, 0.22 * tyres), (0, 0, 0.11 * tyres))


def kerb(_: np.random.Generator, length_m: float) -> Group:
    """Build a kerb along x: it rises from 1 cm at the track (y = 0) to 6 cm at y = 0.7."""
    return painted("kerb", prism([(0.0, -0.05), (0.72, -0.05), (0.72, 0.06), (0.0, 0.01)], length_m))


def barrier(_: np.random.Generator, length_m: float) -> Group:
    """Build a wall of concrete with a sloping foot, along x about the origin."""
    foot = [(-0.3, -0.1), (0.3, -0.1), (0.3, 0.1), (0.13, 0.35), (-0.13, 0.35), (-0.3, 0.1)]
    wall = [(-0.13, 0.35), (0.13, 0.35), (0.1, 0.85), (-0.1, 0.85)]
    return painted("concrete", prism(foot, length_m), prism(wall, length_m)) + solid(
        "barrier", (length_m, 0.6, 0.9), (0, 0, 0.45)
    )


def boards(_: np.random.Generator, materials: Sequence[str], count: int) -> Group:
    """Build ``count`` advertising boards of 4 m x 0.9 m beside each other along x about the origin; they look to -y."""
    parts = [
        painted(
            materials[i % len(materials)], standing_box((3.96, 0.10, 0.9), x_m=4.0 * (i - 0.5 * (count - 1)), z_m=0.1)
        )
        for i in range(count)
    ]
    feet = standing_box((4.0 * count, 0.2, 0.16), z_m=-0.04)
    return together(parts) + painted("metal", feet) + solid("boards", (4.0 * count, 0.3, 1.1), (0, 0, 0.5))


def feather_flag(_: np.random.Generator, material: str) -> Group:
    """Build a tall flag in the shape of a feather in the plane y = 0, at a pole that bends over."""
    rise = np.linspace(0, 1, 9)
    pole = np.stack([0.55 * rise**5, np.zeros(9), 3.3 * rise], axis=-1)
    cloth = np.array(
        [(0.02, 0, 0.7), (0.62, 0, 0.9), (0.86, 0, 2.4), (0.78, 0, 3.1), (0.53, 0, 3.3), (0.2, 0, 2.85), (0.04, 0, 2.2)]
    )
    return (
        painted("steel", tube(pole, np.full(9, 0.035), sides=6))
        + painted(material, moved(fan(cloth), (0.03, 0.0, 0.0)))
        + solid("flag", (1.0, 0.3, 3.4), (0.4, 0, 1.7))
    )


def flag(_: np.random.Generator, material: str, height_m: float) -> Group:
    """Build a pole with a cloth that stands in the wind."""
    pole = turned([(0.0, -0.05), (0.07, -0.05), (0.05, height_m), (0.0, height_m)], sides=8)
    x, z = np.meshgrid(np.linspace(0.06, 1.9, 13), np.linspace(height_m - 1.3, height_m - 0.1, 3))
    cloth = np.stack([x, 0.12 * np.sin(4.2 * x) * x / 1.9, z - 0.06 * x**2], axis=-1)
    uv = np.stack([x - 0.06, height_m - 0.1 - z], axis=-1)
    return (
        painted("steel", pole)
        + painted(material, height_field(cloth, uv))
        + solid("pole", (0.3, 0.3, height_m), (0, 0, 0.5 * height_m))
    )


def flood_mast(_: np.random.Generator, strength: float, height_m: float = 12.0) -> Group:
    """Build a mast with a bank of floodlights that look to -y; ``strength`` as in ``Lamp``."""
    pole = turned([(0.0, -0.1), (0.24, -0.1), (0.24, 0.3), (0.17, 0.5), (0.10, height_m), (0.0, height_m)])
    panel = box((3.0, 0.22, 1.5), (0, -0.12, height_m))
    eyes = [box((0.62, 0.2, 0.46), (x, -0.28, height_m + z)) for x in (-1.05, -0.35, 0.35, 1.05) for z in (-0.38, 0.38)]
    lamp = Group(lamps=(Lamp(position_m=(0.0, -0.7, height_m), strength=strength),))
    return (
        painted("steel", pole, panel)
        + painted("flood glass", *eyes)
        + lamp
        + solid("mast", (0.6, 0.6, height_m), (0, 0, 0.5 * height_m))
    )


def cone(_: np.random.Generator) -> Group:
    """Build a traffic cone, half a metre high."""
    foot = standing_box((0.38, 0.38, 0.05), z_m=-0.01)
    parts = [[(0.155, 0.0), (0.125, 0.14)], [(0.125, 0.14), (0.085, 0.30)], [(0.085, 0.30), (0.035, 0.52), (0.0, 0.52)]]
    lower, middle, upper = (turned(part, sides=14) for part in parts)
    body = painted("cone orange", foot, joined([lower, upper])) + painted("white paint", middle)
    return body + solid("cone", (0.4, 0.4, 0.55), (0, 0, 0.27))
