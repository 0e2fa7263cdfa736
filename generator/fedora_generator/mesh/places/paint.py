"""Procedural pictures, which continue across their opposite edges. Linear reflectance, float32, (h, w, 3)."""

import itertools
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Image = NDArray[np.float32]
Rgb = tuple[float, float, float]
Shape = tuple[int, int]

FINER = 2
"""Flakes are drawn this much larger and averaged, as their edges fall between texels."""


def colour(rgb: ArrayLike) -> Image:
    """Return one or more colours (..., 3) as float32."""
    return np.asarray(rgb, dtype=np.float32)


def fractal(
    rng: np.random.Generator,
    shape: Shape,
    slope: float,
    longest_px: float,
    shortest_px: float = 2.0,
    stretch: tuple[float, float] = (1.0, 1.0),
) -> Image:
    """Periodic noise (h, w) of mean 0 and standard deviation 1.

    Parameters
    ----------
    rng
        Draws white noise, which is filtered.
    shape
        Rows and columns.
    slope
        The amplitude spectrum falls with frequency to this power: 1 gives every octave the same contrast.
    longest_px, shortest_px
        Wavelengths between which the spectrum lies.
    stretch
        Factors by which features are longer along rows (down) and columns (right).
    """
    down = np.fft.fftfreq(shape[0])[:, None] * stretch[0]
    right = np.fft.rfftfreq(shape[1])[None, :] * stretch[1]
    frequency = np.hypot(down, right)
    band = (frequency >= 1 / longest_px) & (frequency <= 1 / shortest_px)
    amplitude = np.where(band, np.maximum(frequency, 1 / longest_px) ** -slope, 0.0)
    noise = np.fft.irfft2(np.fft.rfft2(rng.standard_normal(shape)) * amplitude, s=shape)
    return np.asarray((noise - noise.mean()) / noise.std(), dtype=np.float32)


def between(field: NDArray[np.float32], dark: Rgb, light: Rgb) -> Image:
    """Mix two colours by a field.

    Parameters
    ----------
    field
        (h, w) of standard deviation 1.
    dark, light
        Colours at two deviations below and above 0.
    """
    share = np.clip(0.5 + 0.25 * field, 0, 1)[..., None]
    return np.asarray(colour(dark) + share * (colour(light) - colour(dark)), dtype=np.float32)


def over(below: Image, above: ArrayLike, cover: NDArray[np.float32]) -> Image:
    """Blend a picture or a colour over another.

    Parameters
    ----------
    below
        (h, w, 3).
    above
        (h, w, 3) or (3,).
    cover
        (h, w) weight of ``above``, 0 to 1.
    """
    return np.asarray(below + cover[..., None] * (np.asarray(above, dtype=np.float32) - below), dtype=np.float32)


def flat(shape: Shape, rgb: Rgb) -> Image:
    """One colour everywhere."""
    return np.broadcast_to(colour(rgb), (*shape, 3)).copy()


def flakes(
    rng: np.random.Generator,
    below: Image,
    count: int,
    length_px: float,
    width_px: float,
    colours: Sequence[Rgb],
) -> Image:
    """Scatter pointed flakes in all directions: leaves, blades or pebbles. They continue across the edges.

    Parameters
    ----------
    rng
        Draws colours, positions, directions and sizes.
    below
        (h, w, 3) picture that they lie on.
    count
        Number of flakes.
    length_px, width_px
        Size; each flake is from 0.6 to 1.3 of it.
    colours
        Of the flakes; those of the first colours lie lowest.
    """
    height, width = below.shape[0] * FINER, below.shape[1] * FINER
    levels = cv2.resize(below, (width, height), interpolation=cv2.INTER_NEAREST)
    canvas = np.ascontiguousarray(np.rint(levels * 255).astype(np.uint8))
    palette = np.array(colours)[(np.arange(count) * len(colours)) // count]
    palette = np.rint(255 * palette * rng.uniform(0.8, 1.2, (count, 1))).clip(0, 255)
    centers = rng.uniform(0, 1, (count, 2)) * (width, height)
    angles = np.radians(180.0 * rng.uniform(-1, 1, count))
    along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    across = along[:, ::-1] * (-1, 1)
    sizes = FINER * rng.uniform(0.6, 1.3, (count, 2)) * (length_px, width_px) / 2
    outline = np.array([[-1, 0], [-0.35, -0.8], [0.35, -0.8], [1, 0], [0.35, 0.8], [-0.35, 0.8]])
    scaled = outline[None] * sizes[:, None]
    polygons = centers[:, None] + scaled[..., :1] * along[:, None] + scaled[..., 1:] * across[:, None]

    # Flakes that reach over an edge continue at the opposite edge: as copies, in the order of the flakes.
    low, high = polygons.min(axis=1), polygons.max(axis=1)
    copies, numbers = [], []
    for shift in map(np.array, itertools.product((-width, 0, width), (-height, 0, height))):
        inside = ((high + shift > 0) & (low + shift < (width, height))).all(axis=-1)
        copies.append(polygons[inside] + shift)
        numbers.append(np.flatnonzero(inside))
    order = np.argsort(np.concatenate(numbers), kind="stable")
    corners_px = np.rint(np.concatenate(copies)[order]).astype(np.int32)
    levels_of_copies = palette[np.concatenate(numbers)[order]].tolist()
    for polygon, level in zip(corners_px, levels_of_copies, strict=True):
        cv2.fillConvexPoly(canvas, polygon, level)
    small = cv2.resize(canvas, (below.shape[1], below.shape[0]), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.float32) / np.float32(255)


def courses(
    rng: np.random.Generator, shape: Shape, rows: int, columns: int, joint_px: float, *, staggered: bool = True
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Stones, bricks, tiles or planks in rows.

    Parameters
    ----------
    shape
        Rows and columns of the picture.
    rows, columns
        Number of stones; ``rows`` is even if staggered.
    joint_px
        Width of a joint.
    staggered
        Whether every second row is shifted by half a stone.

    Returns
    -------
    tones
        (h, w) a random number for each stone, standard deviation 1.
    joints
        (h, w) cover of the joints, 0 to 1.
    down
        (h, w) position within a stone, from 0 at its top to 1.
    """
    y = (np.arange(shape[0]) + 0.5) / shape[0] * rows
    x = (np.arange(shape[1]) + 0.5) / shape[1] * columns
    row = np.floor(y).astype(int)
    x_in_row = x[None, :] + (0.5 * (row % 2)[:, None] if staggered else 0.0)
    column = np.floor(x_in_row).astype(int) % columns
    tones = rng.standard_normal((rows, columns))
    edge_y = np.minimum(y - row, 1 - (y - row))[:, None] * shape[0] / rows
    edge_x = np.minimum(x_in_row % 1, 1 - x_in_row % 1) * shape[1] / columns
    joints = np.clip(joint_px / 2 + 0.5 - np.minimum(edge_y, edge_x), 0, 1)
    down = np.broadcast_to((y - row)[:, None], shape)
    return tones[row[:, None], column].astype(np.float32), joints.astype(np.float32), down.astype(np.float32)


def lettering(below: Image, text: str, rgb: Rgb) -> Image:
    """Write a text across the middle of a picture, over 0.6 of its height or 0.86 of its width at most.

    Parameters
    ----------
    below
        (h, w, 3) picture.
    rgb
        Colour of the text.
    """
    height, width = below.shape[:2]
    sheet = np.zeros((240, 120 * (len(text) + 2)), dtype=np.uint8)
    cv2.putText(sheet, text, (60, 160), cv2.FONT_HERSHEY_DUPLEX, 4.0, 255, 14, cv2.LINE_AA)
    rows, columns = (np.flatnonzero(sheet.any(axis=axis)) for axis in (1, 0))
    word = sheet[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(np.float32) / np.float32(255)
    scale = min(0.6 * height / word.shape[0], 0.86 * width / word.shape[1])
    fitted = cv2.resize(
        word, (round(scale * word.shape[1]), round(scale * word.shape[0])), interpolation=cv2.INTER_AREA
    )
    top, left = (height - fitted.shape[0]) // 2, (width - fitted.shape[1]) // 2
    stencil = np.zeros((height, width), dtype=np.float32)
    stencil[top : top + fitted.shape[0], left : left + fitted.shape[1]] = fitted
    return over(below, rgb, stencil)


def bounded(picture: Image) -> Image:
    """Keep reflectances above black, which has no logarithm, and below white."""
    return np.asarray(np.clip(picture, 0.004, 0.98), dtype=np.float32)


def speckled(rng: np.random.Generator, picture: Image, contrast: float) -> Image:
    """Multiply a picture with fine noise, so that every surface has texture at every scale.

    Parameters
    ----------
    picture
        (h, w, 3).
    contrast
        Standard deviation of the logarithm of the noise.
    """
    shape = (picture.shape[0], picture.shape[1])
    noise = fractal(rng, shape, slope=0.8, longest_px=min(shape) / 2)
    return bounded(picture * np.exp(contrast * noise)[..., None])
