"""Vignetting: fall-off of the brightness towards the corners, by frames along the flow."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.flow.residual import HALO_PX, TILE_PX, TileGrid, pixels_of
from fedora_qa.estimators.flow.warp import parts_about
from fedora_qa.estimators.images.gain import LEVELS_DN
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2
from fedora_qa.estimators.images.vignetting import PARTS, CellRatios, PairEquations, fit_vignetting, pair_equations
from fedora_qa.features import Feature
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Interval, owned_intervals
from fedora_qa.views.flow_residuals import sample_tiles
from fedora_qa.views.frame_pairs import flow_rate_of
from fedora_qa.views.warped_frames import FramePair, frame_pair, optics_of

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

TILES: Final = 48
"""Tiles of a field that are compared, of 32 x 32 px: all of a frame of 270x200, 3% of 1440x1080. Other tiles are drawn
for each field, so that no place is left out."""

_CELL_PX: Final = 8
"""Side of a cell: a quarter of a tile."""

_FEWEST_PIXELS: Final = _CELL_PX**2 // 2
"""Least number of the pixels of a cell that both frames must show."""

_WHITE: Final = 255
"""Code at which a channel is clipped."""

_PERCENT: Final = 100.0


@dataclass(frozen=True, slots=True)
class WindowVignetting:
    """Frame pairs of a window.

    Attributes
    ----------
    pairs
        Normal equations of the pairs with enough cells, in the order of time.
    intervals
        Number of fields with a colour frame at both ends.
    """

    pairs: tuple[PairEquations, ...]
    intervals: int


@dataclass(frozen=True, slots=True)
class CornerLoss(Feature):
    """Loss of brightness towards the corners.

    Attributes
    ----------
    percent
        Loss in the farthest corner; negative where the corner is brighter than the centre.
    standard_error_percent
        Of the loss.
    """

    percent: float
    standard_error_percent: float


class ImagesVignetting(WindowCheck[WindowVignetting]):
    """Do frames get darker towards the corners?

    The loss of brightness in the corner that is farthest from the principal point, in percent of the brightness at the
    principal point, in linear light. It is negative where corners are too bright.

    Why it matters
    --------------
    Events, depth and flow of a simulator contain no vignetting. If only the frames have it, a surface gets darker as it
    moves outwards, and no events correspond to the change. Photometric losses and learned features then depend on the
    position in the image.

    How
    ---
    The flow of the slowest rate maps each frame to a later one. Cells of 8 x 8 pixels that both frames show, away from
    edges of the depth and from clipped pixels, have the same radiance in both. The logarithm of the ratio of their
    brightness is proportional to the change of their squared distance from the principal point. Huber's regression over
    the cells of a pair of frames gives the slope, with one constant of the pair for its exposure. All pairs together
    give the loss (``fedora_qa/estimators/images/vignetting.py``). A pair uses 48 tiles of 32 x 32 pixels, a new sample
    for each field; more tiles if the effort requires a larger share. Distances are tangents of angles, so that cropped
    frames, whose principal point is not their middle, are measured about the optical axis.

    Noise model
    -----------
    The scatter of the cells about the fit of their pair contains noise, rounding, detail that the pixels do not
    resolve, and errors of the flow. The standard error is the largest of three: that of independent cells, and those
    from the scatter of whole pairs and of 24 parts of the image, whose cells may share errors. The model error bound is
    half of the variance of a cell's logarithm times its mean change of position: the logarithm of a noisy sum is too
    small by at most that. Frames that were rounded and then darkened keep every code that changes by less than half a
    step. The detection limit therefore includes the loss that darkens the compared surfaces by 1 DN on average.

    Cannot detect
    -------------
    A fall-off that the events and all other streams share. Light that moves with the camera, which has the same effect
    and is reported as vignetting. A fall-off that is not symmetric about the principal point. One that is not quadratic
    in the tangent of the angle is measured with an error of some hundredths of itself. Colour: only luma is compared. A
    loss after rounding that darkens surfaces by less than 1 DN is missed, or measured too small by up to two thirds;
    one of 1 to 2 DN by up to two fifths, where colours are uniform. Motion that changes no distance from the principal
    point, as in hovering flight: the detection limit is stated. Frames so dark or so clipped that few cells remain.
    Specular surfaces have another brightness in each direction: they increase the error. The fall-off of a lamp that is
    fixed in the world belongs to the surfaces.

    Sources
    -------
    D. B. Goldman, Vignette and exposure calibration and compensation, IEEE Trans. Pattern Anal. Mach. Intell. 32 (2010)
    2276: brightness of the same points in several frames determines vignetting and exposure together. The derivation is
    in ``fedora_qa/estimators/images/vignetting.py``.
    """

    name = "images.vignetting"
    needs = ("rgb", "flow")

    def not_applicable(self, facts: Facts) -> str:
        """Return why frames cannot be mapped onto the flow's grid, or have no optical axis; empty where they can."""
        if "rgb" not in facts.declared.cameras:
            return "the camera rgb is not declared in /metadata/cameras, so that the principal point is not known"
        optics = optics_of(facts)
        return optics if isinstance(optics, str) else ""

    def measure(self, window: Window) -> WindowVignetting | None:
        """Compare the frames at both ends of each field of the slowest rate that the window owns."""
        facts = window.facts
        optics, stream = optics_of(facts), slowest_between_frames(facts)
        if isinstance(optics, str) or stream is None or flow_rate_of(window) is None:
            return None
        camera, pairs, intervals = facts.declared.cameras["rgb"], [], 0
        for interval in owned_intervals(window, stream):
            frames = frame_pair(window, optics, interval)
            if frames is None:
                continue
            intervals += 1
            cells = _cell_ratios(frames, interval, camera, window.sampling.tile_share)
            equations = None if cells is None else pair_equations(cells)
            pairs += [equations] if equations else []
        return WindowVignetting(tuple(pairs), intervals)

    def conclude(self, state: Sequence[WindowVignetting], facts: Facts) -> Observation:
        """Return the loss that fits all pairs of frames."""
        pairs = [pair for w in state for pair in w.pairs]
        coverage = Coverage(len(pairs), sum(w.intervals for w in state), "frame pairs")
        fit = fit_vignetting(pairs)
        if fit is None:
            why = "no two frames at the ends of a flow field share enough surfaces that are neither dark nor clipped"
            return Observation(coverage, unobservable=why)
        loss = fit.loss_percent
        # d loss / d a = exp(-|a|), which is 1 for a correct file. The limit is that of a correct file.
        error = _PERCENT * fit.standard_error
        feature = CornerLoss(loss, exp(-abs(fit.a)) * error)
        change = "darker" if loss > 0 else "brighter"
        return Observation(
            coverage,
            (
                Statistic(
                    name="corner_loss",
                    value=loss,
                    unit="percent",
                    standard_error=error,
                    model_error_bound=_PERCENT * fit.model_error_bound,
                    resolution=_PERCENT * fit.step,
                    statement=f"The frames get {change} from the principal point to the farthest corner, by "
                    f"{abs(loss):.3g} +/- {feature.standard_error_percent:.2g}%, at the same surfaces.",
                    code="images.vignetting.corner",
                    where=Where(stream="rgb"),
                    features=(feature,),
                ),
            ),
        )


def slowest_between_frames(facts: Facts) -> str | None:
    """Return the slowest flow stream with a field that has a colour frame at both ends; None where there is none.

    Parameters
    ----------
    facts
        With the clocks of the colour frames and of the flow.

    Returns
    -------
    str or None
        ``flow/<rate>hz``.
    """
    frames_ns = facts.clocks["rgb"].times_ns
    for stream in facts.flow_streams:
        clock = facts.clocks[stream]
        if clock.ends_ns is not None and np.any(np.isin(clock.times_ns, frames_ns) & np.isin(clock.ends_ns, frames_ns)):
            return stream
    return None


def _cell_ratios(frames: FramePair, interval: Interval, camera: Camera, tile_share: float) -> CellRatios | None:
    """Return the brightness of the same surfaces at both ends of a field, of at least a share of its tiles (0 to 1)."""
    height, width = frames.window.flow_px(interval.stream, interval.row).shape[:2]
    count = len(TileGrid.of(height, width).origins)
    tiles = sample_tiles(frames, interval, min(1.0, max(tile_share, TILES / max(count, 1))))
    if tiles is None or not tiles.usable.any():
        return None
    tiles = tiles.chosen(np.asarray(tiles.usable.any(axis=(1, 2))))
    inner = slice(HALO_PX, -HALO_PX)
    flow_px = tiles.flow_px[:, inner, inner]
    columns, rows = (places.astype(np.float32) for places in pixels_of(tiles.origins, halo_px=0))
    later = columns + flow_px[..., 0], rows + flow_px[..., 1]
    before_dn = frames.first(tiles.origins)[:, inner, inner]
    after_dn = frames.second(*later)
    usable = tiles.usable
    squared_radii = []
    for frame, places in ((frames.before, (columns, rows)), (frames.after, later)):
        x, y = frames.on_frame(*places)
        squared_radii.append(squared_radius(camera, x, y))
        usable = usable & ~_near_clipped(frames, frame, x, y)
    pixels = _sums(usable)
    values = np.stack((before_dn, after_dn, *squared_radii))
    before, after, s1, s2 = (_sums(np.where(usable, image, 0.0)) for image in values)
    with np.errstate(divide="ignore", invalid="ignore"):
        level_dn = np.sqrt(before * after) / pixels
    # The geometric mean of both frames, so that the choice favours neither.
    chosen = (pixels >= _FEWEST_PIXELS) & (level_dn >= LEVELS_DN[0]) & (level_dn <= LEVELS_DN[1])
    pixels, before, after, s1, s2 = (values[chosen] for values in (pixels, before, after, s1, s2))
    tile, cell_row, cell_column = np.nonzero(chosen)
    centre = tiles.origins[tile] + _CELL_PX * np.stack((cell_column, cell_row), axis=-1) + _CELL_PX // 2
    part_column, part_row = (centre * (PARTS[1], PARTS[0]) // (width, height)).T
    return CellRatios(
        np.log(after / before),
        (s1 - s2) / pixels,
        pixels * LUMA_ROUNDING_VARIANCE_DN2 * (before**-2 + after**-2),
        level_dn[chosen] * (s1 + s2) / (2 * pixels),
        part_row * PARTS[1] + part_column,
    )


def squared_radius(camera: Camera, columns: NDArray[np.floating], rows: NDArray[np.floating]) -> Float64:
    """Return the squared tangent of the angle to the optical axis, as a share of that of the farthest corner.

    Parameters
    ----------
    camera
        Of the image.
    columns, rows
        Positions in its image, px, of any shape.

    Returns
    -------
    ndarray of float64
        Of the same shape: 0 at the principal point, 1 in the farthest corner.
    """

    def squared_tangent(x: NDArray[np.floating], y: NDArray[np.floating]) -> Float64:
        slope_x, slope_y = rays_of_pixels(camera.K, camera.lens, np.asarray(x, np.float64), np.asarray(y, np.float64))
        return np.asarray(slope_x**2 + slope_y**2)

    right, bottom = camera.width - 1.0, camera.height - 1.0
    corners = squared_tangent(np.array([0.0, right, 0.0, right]), np.array([0.0, 0.0, bottom, bottom]))
    return np.asarray(squared_tangent(columns, rows) / corners.max())


def _near_clipped(frames: FramePair, frame: int, x: Float32, y: Float32) -> Mask:
    """Return where the smoothed values at positions (n, s, s) in a frame depend on a clipped pixel.

    Smoothing spreads the light of a bright spot farther over the surface in the frame that shows the surface smaller.
    Beside a spot that is left out, that frame would always be the brighter of both.
    """
    rgb, reach = frames.window.rgb(frame), frames.reach_px
    height, width = rgb.shape[:2]
    x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)
    near = np.zeros(x.shape, np.bool_)
    # Only the part of the frame about each tile is searched: tiles are few hundredths of a large frame.
    for i, (left, top, right, bottom) in enumerate(parts_about(x, y, width, height).tolist()):
        first_x, first_y = max(left - reach, 0), max(top - reach, 0)
        white = rgb[first_y : bottom + reach, first_x : right + reach] == _WHITE
        if white.any():
            spots = white.any(axis=-1).view(np.uint8)
            dilated = cv2.dilate(spots, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
            columns, rows = (
                np.clip(np.nan_to_num(np.rint(places)), 0, size - 1).astype(np.intp) - first
                for places, size, first in ((x[i], width, first_x), (y[i], height, first_y))
            )
            near[i] = dilated[rows, columns] > 0
    return near


def _sums(values: NDArray[np.generic]) -> Float64:
    """Return the sums over the cells (n, 4, 4) of tiles (n, 32, 32)."""
    cells = TILE_PX // _CELL_PX
    return np.asarray(values.reshape(-1, cells, _CELL_PX, cells, _CELL_PX).sum(axis=(2, 4), dtype=np.float64))
