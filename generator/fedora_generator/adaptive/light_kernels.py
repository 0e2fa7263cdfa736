"""The signal of a pixel, or of all pixels of a tile, at any instant of a camera's path."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_generator.adaptive.camera_path import RAY_ENTRIES
from fedora_generator.surfaces.pixel_kernels import MAX_CORNERS, MAX_PIECES, Pieces
from fedora_generator.surfaces.render_kernels import TILE, render_pixel
from fedora_generator.surfaces.shading_kernels import Surfaces, View
from fedora_generator.surfaces.texture_kernels import TextureTable
from fedora_generator.surfaces.visibility_kernels import LINES_PER_FACE, FaceFrames, possible_faces, project_face
from fedora_generator.threads import UNCOUNTED

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Sensor(NamedTuple):
    """The pixels: ``reference`` and ``signal`` (H, W) are changed; thresholds are (H, W), or (1, W) for all rows.

    The signal is ln(luma + ``log_eps_dn``) and what has leaked: ``leak_per_s`` thresholds a second since the start of
    the recording, which lies ``elapsed_s`` before that of the path.
    """

    reference: Floats
    signal: Floats
    threshold_on: Floats
    threshold_off: Floats
    log_eps_dn: float
    leak_per_s: float
    elapsed_s: float


class Scratch(NamedTuple):
    """Scratch space of every thread, first index.

    Loops that count no references to arrays (``UNCOUNTED``) cannot make any themselves.
    """

    lines: Floats
    rays: Floats
    cameras_m: Floats
    sums: Floats
    given: Integers
    in_pixel: Integers
    piece_x: Floats
    piece_y: Floats
    piece_corners: Integers
    piece_states: Integers
    terms: Floats
    radiance_dn: Floats
    signal: Floats
    values: Floats
    stack: Floats
    before: Floats
    rendered: Integers


def scratch_for(threads: int, faces: int, waves: int, samples: int, entries: int, depth: int) -> Scratch:
    """Scratch space for tiles of at most so many faces and samples.

    Parameters
    ----------
    threads
        Number of threads.
    faces, samples
        Largest numbers of a tile.
    waves
        Waves of a texture.
    entries
        Entries of a row of path coefficients.
    """
    pixels = TILE * TILE
    return Scratch(
        lines=np.empty((threads, faces, LINES_PER_FACE, 3)),
        rays=np.empty((threads, 3, 3)),
        cameras_m=np.empty((threads, (entries - RAY_ENTRIES) // 3, 3)),
        sums=np.empty((threads, 2, entries)),
        given=np.empty((threads, faces), np.int64),
        in_pixel=np.empty((threads, faces), np.int64),
        piece_x=np.empty((threads, MAX_PIECES + 1, MAX_CORNERS)),
        piece_y=np.empty((threads, MAX_PIECES + 1, MAX_CORNERS)),
        piece_corners=np.empty((threads, MAX_PIECES), np.int64),
        piece_states=np.empty((threads, faces), np.int64),
        terms=np.empty((threads, waves)),
        radiance_dn=np.empty((threads, 1)),
        signal=np.empty((threads, 1)),
        values=np.empty((threads, samples + 1, pixels)),
        stack=np.empty((threads, depth, 6)),
        before=np.empty((threads, pixels)),
        rendered=np.empty((threads, 1), np.int64),
    )


class Stage(NamedTuple):
    """What one thread renders, a world of a single colour along a camera path, and its scratch space.

    ``view`` holds the faces of the tile, ``given`` which of them may be seen; ``rendered`` (1,) counts pixels.
    """

    textures: TextureTable
    surfaces: Surfaces
    frames: FaceFrames
    bodies: Integers
    coefficients: Floats
    span_s: float
    view_front: Integers
    view_lines: Floats
    view_rays: Floats
    cameras_m: Floats
    sums: Floats
    given: Integers
    in_pixel: Integers
    pieces: Pieces
    terms: Floats
    radiance_dn: Floats
    signal: Floats
    rendered: Integers


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def stage_of(
    textures: TextureTable,
    surfaces: Surfaces,
    frames: FaceFrames,
    bodies: Integers,
    coefficients: Floats,
    span_s: float,
    faces: Integers,
    scratch: Scratch,
    thread: int,
) -> Stage:
    """Stage of one tile, whose faces are given, for one thread."""
    count = len(faces)
    return Stage(
        textures,
        surfaces,
        frames,
        bodies,
        coefficients,
        span_s,
        faces,
        scratch.lines[thread, :count],
        scratch.rays[thread],
        scratch.cameras_m[thread],
        scratch.sums[thread],
        scratch.given[thread, :count],
        scratch.in_pixel[thread, :count],
        Pieces(
            scratch.piece_x[thread],
            scratch.piece_y[thread],
            scratch.piece_corners[thread],
            scratch.piece_states[thread],
        ),
        scratch.terms[thread],
        scratch.radiance_dn[thread],
        scratch.signal[thread],
        scratch.rendered[thread],
    )


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def look(
    frames: FaceFrames,
    bodies: Integers,
    coefficients: Floats,
    share: float,
    view: View,
    cameras_m: Floats,
    sums: Floats,
) -> None:
    """Turn ``view``, in place, to how its faces (``front``) appear at a share (0 to 1) of the path.

    Parameters
    ----------
    bodies
        Body (faces,) that each face belongs to.
    coefficients
        (terms, entries) of Chebyshev polynomials, as in ``CameraPath``.
    share
        0 at the start of the path, 1 at its end.
    view
        Its ``rays`` and ``lines`` are overwritten.
    cameras_m, sums
        Scratch space (bodies, 3) and (2, entries).
    """
    # Clenshaw's recurrence: b_k = c_k + 2 x b_(k+1) - b_(k+2), then f(x) = c_0 + x b_1 - b_2.
    x = 2.0 * share - 1.0
    sums[:] = 0.0
    for term in range(len(coefficients) - 1, 0, -1):
        for entry in range(sums.shape[1]):
            value = coefficients[term, entry] + 2.0 * x * sums[0, entry] - sums[1, entry]
            sums[1, entry] = sums[0, entry]
            sums[0, entry] = value
    for entry in range(sums.shape[1]):
        row, column = divmod(entry, 3)
        value = coefficients[0, entry] + x * sums[0, entry] - sums[1, entry]
        if row < 3:
            view.rays[row, column] = value
        else:
            cameras_m[row - 3, column] = value
    for index in range(len(view.front)):
        face = view.front[index]
        project_face(frames, face, cameras_m[bodies[face]], view.rays, view.lines[index])


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def sample_block(
    stage: Stage, sensor: Sensor, column: int, row: int, rows: int, columns: int, share: float, values: Floats
) -> None:
    """Compute the signals of a block of a tile at a share of the path.

    Parameters
    ----------
    stage
        World, path and scratch space of the thread.
    column, row
        First pixel of the block.
    share
        0 at the start of the path, 1 at its end.
    values
        (pixels,) to fill, in raster order.
    """
    textures, surfaces, given, in_pixel = stage.textures, stage.surfaces, stage.given, stage.in_pixel
    pieces, terms, radiance_dn = stage.pieces, stage.terms, stage.radiance_dn
    view = View(stage.view_front, stage.view_lines, stage.view_rays)
    look(stage.frames, stage.bodies, stage.coefficients, share, view, stage.cameras_m, stage.sums)
    for index in range(len(given)):  # at first every face of the tile
        given[index] = index
    x_middle, y_middle = column + 0.5 * (columns - 1), row + 0.5 * (rows - 1)
    half = 0.5 * max(rows, columns)
    # The list is shortened in place: a face moves to the front of itself.
    count, uniform = possible_faces(view.lines, given, len(given), x_middle, y_middle, half, given)
    for y in range(rows):
        for x in range(columns):
            render_pixel(
                textures,
                surfaces,
                view,
                given,
                count,
                uniform,
                column + x,
                row + y,
                in_pixel,
                pieces,
                terms,
                radiance_dn,
            )
            values[y * columns + x] = math.log(radiance_dn[0] + sensor.log_eps_dn)
    if sensor.leak_per_s > 0.0:
        for y in range(rows):
            for x in range(columns):
                # Leak acts as a signal that rises for ever.
                on, _ = thresholds_of(sensor, column + x, row + y)
                values[y * columns + x] += float(sensor.leak_per_s * on * (sensor.elapsed_s + share * stage.span_s))
    stage.rendered[0] += rows * columns


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def signal_at(stage: Stage, sensor: Sensor, x: int, y: int, share: float) -> float:
    """Signal of one pixel of the tile at any share of the path."""
    side = int(np.int64(1))  # a literal is a type of its own, for which Numba would compile the callee once more
    sample_block(stage, sensor, x, y, side, side, share, stage.signal)
    return float(stage.signal[0])


@njit(cache=True, error_model="numpy", **UNCOUNTED, inline="always")
def thresholds_of(sensor: Sensor, x: int, y: int) -> tuple[float, float]:
    """Thresholds of a pixel, brighter and darker."""
    row_on, row_off = y if len(sensor.threshold_on) > 1 else 0, y if len(sensor.threshold_off) > 1 else 0
    return sensor.threshold_on[row_on, x], sensor.threshold_off[row_off, x]
