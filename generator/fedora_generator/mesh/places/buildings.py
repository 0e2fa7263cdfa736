"""Buildings: walls with windows and doors that stand out from them, and roofs.

Each stands on z = 0 about the origin of a frame of its own; metres.
"""

import math
from typing import Final

import numpy as np

from fedora_generator.mesh.places.group import Group, painted, solid, together
from fedora_generator.mesh.places.shapes import Point, box, cylinder, prism, standing_box
from fedora_generator.mesh.places.surface import fan, joined, moved, quads

SUNK_M: Final = 0.2
"""How deep walls reach into the ground, so that no edge lies in it."""

LIT: Final = ("glass", "glass", "lit window", "dim window", "glass", "lit window")
"""Windows of a building, in random order."""


def house(
    rng: np.random.Generator,
    size_m: Point,
    *,
    storeys: int = 2,
    wall: str = "brick",
    roof: str = "roof tiles",
    roof_rise_m: float = 2.4,
    window_m: tuple[float, float] = (1.0, 1.4),
    spacing_m: float = 2.4,
) -> Group:
    """Build a house along x about the origin; its door looks to -y.

    Parameters
    ----------
    rng
        Draws which windows are lit.
    size_m
        Length along x, depth along y, height of the walls.
    storeys
        Rows of windows.
    wall, roof
        Materials.
    roof_rise_m
        Height of the ridge over the walls; 0 gives a flat roof with a cornice and a parapet.
    window_m
        Width and height of a window.
    spacing_m
        Least distance between the middles of two windows.
    """
    length, depth, height = size_m
    walls = painted(wall, standing_box((length, depth, height + SUNK_M), z_m=-SUNK_M))
    plinth = painted("stone", standing_box((length + 0.12, depth + 0.12, 0.45 + SUNK_M), z_m=-SUNK_M))
    facades = []
    for yaw_deg, width, away in (
        (0.0, length, depth),
        (90.0, depth, length),
        (180.0, length, depth),
        (270.0, depth, length),
    ):
        yaw_rad = math.radians(yaw_deg)
        foot_m = (0.5 * away * math.sin(yaw_rad), -0.5 * away * math.cos(yaw_rad))
        # Windows of a wall in rows, and the door in the middle of the front.
        door = yaw_deg == 0.0
        columns = max(1, int((width - 0.8) // spacing_m))
        storey_m = height / storeys
        parts = [entrance().at(0, 0, 0.16)] if door else []
        for row in range(storeys):
            for column in range(columns):
                x_m = (column + 0.5 - 0.5 * columns) * (width - 0.8) / columns
                if door and row == 0 and abs(x_m) < 0.6 * window_m[0] + 0.9:
                    continue
                sill_m = row * storey_m + 0.36 * storey_m
                parts.append(window(*window_m, LIT[rng.integers(len(LIT))]).at(x_m, 0, sill_m))
        facades.append(together(parts).at(*foot_m, yaw_deg=yaw_deg))
    if roof_rise_m > 0:
        top = gable_roof(size_m, roof_rise_m, wall, roof)
    else:
        cornice = standing_box((length + 0.5, depth + 0.5, 0.35), z_m=height - 0.1)
        parapet = standing_box((length + 0.2, depth + 0.2, 0.6), z_m=height + 0.1)
        top = painted("stone", cornice, parapet)
    whole_m = (length + 0.6, depth + 0.6, height + roof_rise_m)
    return walls + plinth + together(facades) + top + solid("house", whole_m, (0, 0, 0.5 * whole_m[2]))


def gable_roof(size_m: Point, rise_m: float, wall: str, roof: str) -> Group:
    """Build two slopes over the length with eaves, the gables under them, and a chimney.

    Parameters
    ----------
    size_m
        Of the walls below: length, depth and height.
    rise_m
        Height of the ridge over the walls.
    wall, roof
        Materials of the gables and of the slopes.
    """
    length, depth, height = size_m
    half, rise, eave, thick = 0.5 * depth, rise_m, 0.45, 0.18
    reach = half + eave
    low = height - eave * rise / half
    ends = 0.5 * length + eave
    front = np.array([[-ends, -reach, low], [ends, -reach, low], [ends, 0, height + rise], [-ends, 0, height + rise]])
    slopes = np.stack([front, front * (-1.0, -1.0, 1.0)])
    lift_m = np.array([0.0, 0.0, thick])
    top, under = quads(slopes + lift_m), quads(slopes[:, ::-1])
    borders = [slopes[:, [i, i + 1]] for i in (0, 1)] + [slopes[:, [3, 0]]]
    edges = [quads(np.concatenate([border, border[:, ::-1] + lift_m], axis=1)) for border in borders]
    gables = [
        fan(np.array([[x, -y, height], [x, y, height], [x, 0, height + rise - 0.02]]))
        for x, y in ((0.5 * length, half), (-0.5 * length, -half))
    ]
    chimney = standing_box((0.7, 0.7, rise + 0.7), 0.28 * length, 0.2 * depth, height)
    return painted(roof, top) + painted("white paint", *edges, under) + painted(wall, *gables, chimney)


def window(width_m: float, height_m: float, pane: str) -> Group:
    """Build a window in a wall in the plane y = 0, seen from -y: frame, sill, panes with a cross between them."""
    rim = 0.09
    frame = [box((rim, 0.14, height_m), (side * 0.5 * (width_m - rim), 0, 0.5 * height_m)) for side in (-1, 1)] + [
        box((width_m - 2 * rim, 0.14, rim), (0, 0, z)) for z in (0.5 * rim, height_m - 0.5 * rim)
    ]
    cross = [
        box((0.06, 0.08, height_m - 2 * rim), (0, 0, 0.5 * height_m)),
        box((width_m - 2 * rim, 0.06, 0.06), (0, 0, 0.64 * height_m)),
    ]
    sill = standing_box((width_m + 0.16, 0.34, 0.08), z_m=-0.08)
    glass = box((width_m - 1.5 * rim, 0.03, height_m - 1.5 * rim), (0, 0, 0.5 * height_m))
    return painted("white paint", *frame, *cross) + painted("stone", sill) + painted(pane, glass)


def entrance() -> Group:
    """Build a panelled door with a frame and a step, in the plane y = 0, seen from -y."""
    width_m, height_m = 1.1, 2.2
    posts = [standing_box((0.14, 0.28, height_m + 0.14), x_m=side * (0.5 * width_m + 0.07)) for side in (-1, 1)]
    lintel = standing_box((width_m, 0.28, 0.14), z_m=height_m)
    leaf = standing_box((width_m, 0.2, height_m))
    panels = [standing_box((0.36 * width_m, 0.25, 0.3 * height_m), x, 0, z) for x in (-0.24, 0.24) for z in (0.3, 1.2)]
    step = standing_box((width_m + 0.6, 1.0, 0.16 + SUNK_M), z_m=-0.16 - SUNK_M)
    return painted("white paint", *posts, lintel) + painted("wood", leaf, *panels) + painted("stone", step)


def tower_block(rng: np.random.Generator, size_m: Point) -> Group:
    """Build a tall building far away: storeys of windows, some of them lit."""
    length, depth, height = size_m
    rows, columns = int(height // 3.4), int(length // 3.0)
    panes: dict[str, list[tuple[float, float]]] = {}
    for row in range(1, rows):
        for column in range(columns):
            place = ((column + 0.5) * length / columns - 0.5 * length, 3.4 * row)
            panes.setdefault(LIT[rng.integers(len(LIT))], []).append(place)
    body = painted("concrete", standing_box((length, depth, height + 1), z_m=-1.0))
    head = painted("concrete", standing_box((0.5 * length, 0.5 * depth, 3.0), z_m=height))
    front = together(
        painted(pane, joined([box((2.0, 0.6, 1.9), (x, -0.5 * depth, z)) for x, z in places]))
        for pane, places in panes.items()
    )
    return body + head + front + front.at(0, 0, yaw_deg=180.0)


def colonnade(_: np.random.Generator, length_m: float, columns: int, height_m: float) -> Group:
    """Build a row of stone columns on steps under a pediment, along x; its front looks to -y."""
    xs = np.linspace(-0.5 * length_m + 0.6, 0.5 * length_m - 0.6, columns).tolist()
    shafts = [moved(cylinder(0.34, height_m - 0.9, sides=16), (x, 0, 0.7)) for x in xs]
    feet = [standing_box((0.95, 0.95, 0.22), x_m=x, z_m=0.58) for x in xs]
    caps = [standing_box((0.95, 0.95, 0.24), x_m=x, z_m=height_m - 0.34) for x in xs]
    steps = [standing_box((length_m + 1.2 * i, 1.4 + 1.2 * i, 0.6 + SUNK_M - 0.2 * i), z_m=-SUNK_M) for i in range(3)]
    beam = standing_box((length_m + 0.4, 1.5, 0.8), z_m=height_m - 0.12)
    outline = np.array([(-0.5 * length_m - 0.5, 0.0), (0.5 * length_m + 0.5, 0.0), (0.0, 0.17 * length_m)])
    gable = moved(prism(outline, 1.9), (0, 0, height_m + 0.66), yaw_deg=90.0)
    return painted("white stone", *shafts, *feet, *caps, *steps, beam) + painted("sandstone", gable)
