"""Colour and depth frames that cameras, renderers, converters and writers spoil."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA

COLOUR: Final = "path/rgb"
DEPTH: Final = "path/depth"
WHITE: Final = 255


def blue_first(file: h5py.File, plan: Plan) -> None:
    """Channels are B, G, R."""
    replace_values(file, COLOUR, np.ascontiguousarray(file[COLOUR][...][..., ::-1]))


def exposed_otherwise_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Colour frames of the plan's rows have so many percent more light, and are clipped at white."""
    frames = file[COLOUR][...]
    codes = np.rint(np.minimum(WHITE, np.arange(WHITE + 1) * (1 + plan.size / 100))).astype(frames.dtype)
    rows = plan.rows(len(frames))
    frames[rows] = codes[frames[rows]]
    replace_values(file, COLOUR, frames)


def darker_at_the_border(file: h5py.File, plan: Plan) -> None:
    """Light falls with the square of the distance from the principal point, by so many percent at the far corner."""
    frames = file[COLOUR][...]
    K = np.array(file[CAMERA + "rgb"].attrs["K"])
    y, x = np.indices(frames.shape[1:3], dtype=np.float64)
    squared = (x - K[0, 2]) ** 2 + (y - K[1, 2]) ** 2
    light = 1 - plan.size / 100 * squared / squared.max()
    for number, frame in enumerate(frames):
        frames[number] = np.rint(frame * light[..., None]).astype(frames.dtype)
    replace_values(file, COLOUR, frames)


def depth_shifted(file: h5py.File, plan: Plan) -> None:
    """Depth lies so many pixels from its place, in any direction; what enters the image has no value."""
    values = file[DEPTH][...]
    angle = plan.random.uniform(0, 2 * np.pi)
    down, right = (round(plan.size * share) for share in (np.sin(angle), np.cos(angle)))
    rows, columns = (np.arange(extent) - by for extent, by in zip(values.shape[1:], (down, right), strict=True))
    shifted = np.full_like(values, np.nan)
    to_rows, to_columns = ((at >= 0) & (at < len(at)) for at in (rows, columns))
    for number, frame in enumerate(values):
        shifted[number][np.ix_(to_rows, to_columns)] = frame[np.ix_(rows[to_rows], columns[to_columns])]
    replace_values(file, DEPTH, shifted)


def depth_along_rays(file: h5py.File, plan: Plan) -> None:
    """Depth is the distance from the centre of the camera."""
    values = file[DEPTH][...]
    K = np.array(file[CAMERA + "depth"].attrs["K"])
    y, x = np.indices(values.shape[1:], dtype=np.float64)
    length = np.sqrt(1 + ((x - K[0, 2]) / K[0, 0]) ** 2 + ((y - K[1, 2]) / K[1, 1]) ** 2)
    replace_values(file, DEPTH, (values * length).astype(values.dtype))


def depth_without_value_as_a_number(file: h5py.File, plan: Plan) -> None:
    """Pixels without depth are 0 or infinite, by chance."""
    values = file[DEPTH][...]
    values[np.isnan(values)] = plan.random.choice([0.0, np.inf])
    replace_values(file, DEPTH, values)


def depth_repeated(file: h5py.File, plan: Plan) -> None:
    """So many depth frames in sequence are the one before them."""
    values = file[DEPTH][...]
    count = min(int(plan.size), len(values) - 2)
    first = 1 + round(plan.begin * (len(values) - count - 1))
    values[first : first + count] = values[first - 1]
    replace_values(file, DEPTH, values)
