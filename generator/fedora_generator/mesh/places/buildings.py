"""Buildings: houses with windows and doors, and the grandstand, pits and tower of a racetrack.

Each stands on z = 0 about the origin of a frame of its own; metres.
"""

import math
from typing import Final

import numpy as np

from fedora_generator.mesh.places.furniture import railing
from fedora_generator.mesh.places.shapes import Point, box, cylinder, prism, standing_box
from fedora_generator.mesh.places.surface import Group, Surface, fan, joined, moved, painted, quads, solid, together

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


def grandstand(_: np.random.Generator, length_m: float, rows: int) -> Group:
    """Rows of seats that rise to the back under a roof, along x about the origin; they look to -y."""
    deep, rise, first = 0.9, 0.42, 1.3
    steps = [standing_box((length_m, deep, first + rise * i + 0.1), 0, (i + 0.5) * deep, -0.1) for i in range(rows)]
    seats: dict[str, list[Surface]] = {colour: [] for colour in ("blue seat", "white seat", "red seat")}
    colours = list(seats)
    for row in range(rows):
        for number in range(int(length_m / 0.6)):
            x = -0.5 * length_m + 0.6 * (number + 0.5)
            if abs(x % 9.0 - 4.5) < 0.7:
                continue  # a way between the blocks
            block = int(abs(x) // 9.0)
            colour = colours[(block + (row > 4)) % 3]
            floor = first + rise * row
            seats[colour].append(box((0.5, 0.46, 0.08), (x, (row + 0.52) * deep, floor + 0.3)))
            seats[colour].append(box((0.48, 0.07, 0.5), (x, (row + 0.78) * deep, floor + 0.52)))
    back_y, top = rows * deep, first + rise * rows + 3.2
    back = standing_box((length_m, 0.3, top), y_m=back_y + 0.15)
    columns = [standing_box((0.3, 0.3, top), x, back_y - 0.4, 0) for x in np.linspace(-0.46, 0.46, 6) * length_m]
    roof = box((length_m + 1.0, back_y + 2.0, 0.35), (0, 0.5 * back_y - 0.2, top + 0.1))
    edge = box((length_m + 1.1, 0.3, 0.9), (0, -1.15, top + 0.1))
    rail = railing(length_m).at(0, 0.2, first)
    size_m = (length_m + 1, back_y + 2.5, top + 0.6)
    return (
        painted("concrete", *steps, back)
        + together(painted(colour, joined(parts)) for colour, parts in seats.items() if parts)
        + painted("steel", *columns, roof)
        + painted("roof edge", edge)
        + rail
        + solid("grandstand", size_m, (0, 0.5 * back_y - 0.2, 0.5 * size_m[2]))
    )


def pits(_: np.random.Generator, length_m: float, garages: int) -> Group:
    """Garages below, a band of windows above, a terrace on top; along x about the origin, it looks to -y."""
    depth, lower, upper = 8.0, 3.6, 2.8
    pitch = length_m / garages
    xs = ((np.arange(garages) + 0.5) * pitch - 0.5 * length_m).tolist()
    body = standing_box((length_m, depth, lower + 0.2), z_m=-0.2)
    above = standing_box((length_m, depth - 1.4, upper), y_m=0.5, z_m=lower)
    roof = standing_box((length_m + 0.8, depth, 0.3), y_m=0.2, z_m=lower + upper)
    slab = standing_box((length_m + 0.6, 2.2, 0.26), y_m=-0.5 * depth - 0.3, z_m=lower - 0.12)
    front = -0.5 * depth
    shutters = [standing_box((pitch - 1.2, 0.16, 2.7), x, front) for x in xs]
    pillars = [standing_box((0.5, 0.5, lower), x - 0.5 * pitch, front, -0.1) for x in [*xs, xs[-1] + pitch]]
    signs = [standing_box((1.6, 0.12, 0.56), x, front - 0.02, 2.82) for x in xs]
    panes: dict[str, list[float]] = {"glass": xs[::2], "lit window": xs[1::2]}
    bands = [
        painted(
            pane, *(standing_box((pitch - 0.7, 0.16, 1.5), x, 0.5 - 0.5 * (depth - 1.4), lower + 0.8) for x in places)
        )
        for pane, places in panes.items()
    ]
    bars = [
        standing_box((0.1, 0.26, 1.7), x + d, 0.5 - 0.5 * (depth - 1.4), lower + 0.7) for x in xs for d in (-0.8, 0.8)
    ]
    size_m = (length_m + 1, depth + 2.0, lower + upper + 0.3)
    return (
        painted("plaster", body, above)
        + painted("concrete", roof, slab, *pillars)
        + painted("shutter", *shutters)
        + painted("pit sign", *signs)
        + together(bands)
        + painted("white paint", *bars)
        + railing(length_m).at(0, front - 1.2, lower + 0.14)
        + solid("pits", size_m, (0, -0.5, 0.5 * size_m[2]))
    )


def control_tower(rng: np.random.Generator) -> Group:
    """Build a square tower with a glazed cabin that stands over it."""
    shaft = house(rng, (5.0, 5.0, 9.0), storeys=3, wall="concrete", roof_rise_m=0.0, window_m=(0.9, 1.2), spacing_m=2.0)
    cabin = painted("lit window", standing_box((6.0, 6.0, 2.0), z_m=9.9))
    bars = [standing_box((0.14, 0.14, 2.2), x, y, 9.8) for x in (-3, 0, 3) for y in (-3, 3)]
    bars += [standing_box((0.14, 0.14, 2.2), x, 0, 9.8) for x in (-3, 3)]
    slabs = [standing_box((6.8, 6.8, 0.3), z_m=z) for z in (9.62, 11.9)]
    size_m = (7.0, 7.0, 12.4)
    return (
        shaft
        + cabin
        + painted("white paint", *bars)
        + painted("concrete", *slabs)
        + solid("tower", size_m, (0, 0, 6.2))
    )
