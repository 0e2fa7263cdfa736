"""Buildings at a racetrack: the grandstand, the pits and the control tower.

Each stands on z = 0 about the origin of a frame of its own; metres.
"""

import numpy as np

from fedora_generator.mesh.places.buildings import house
from fedora_generator.mesh.places.furniture import railing
from fedora_generator.mesh.places.group import Group, painted, solid, together
from fedora_generator.mesh.places.shapes import box, standing_box
from fedora_generator.mesh.places.surface import Surface, joined


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
