"""Neighbouring depth frames and the camera's motion between them.

A pair belongs to the window of its second frame. Only some pixels of the first frame are needed; the window before has
computed them, so each frame is prepared once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.depth.inverse_depth import DepthImage, depth_image
from fedora_qa.estimators.depth.pair_fit import DepthFit, Family, fit_depth, noise_directions
from fedora_qa.estimators.depth.warp import (
    DepthLattice,
    DepthModel,
    WarpedLattice,
    lattice_stride,
    lattice_values,
    warp,
)
from fedora_qa.estimators.images.values import positive_extremes
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.stored_step import DOUBLE_ROUNDOFF, StoredStep
from fedora_qa.sequence.window import USUAL_PIXELS, Window
from fedora_qa.views.flow_intervals import PoseTrack, motion_between, pose_of_frame, pose_track
from fedora_qa.views.pixel_lattice import has_static_depth, static_depth_m, why_no_static_depth

Float64 = NDArray[np.float64]

FIT_PIXELS: Final = 2000
"""Pixels that a parameter is fitted to: plenty for seven numbers, since what remains is rounding."""

FIT_PIXELS_OF_LARGE: Final = FIT_PIXELS // 2
"""Pixels of frames that are sampled at some rows and columns. Errors common to all pixels dominate the limits: at
1440x1080 standard errors grow by 41%, the limits of scale and ray by 1.6% and 0.9%."""

_PIXELS: Final = USUAL_PIXELS
"""Approximate number of pixels of a frame that are sampled: every second, third ... row and column of larger frames.

A frame of 540x405 px constrains as much: values between two pixels are interpolated, and their error is bounded by
second differences of the sampled pixels. Distances from edges are measured by blocks of two of these, as they are in
540x405. At 1440x1080, every third pixel both ways, frames take a seventh of the time; in park-day the limit of the
whole frame grows by 1%, that of the worst tile by 11%, of the scale by 9%, of the ray's exponent by 4%. ``exhaustive``
samples all.
"""

_FREE_MOTION_M, _FREE_MOTION_RAD = 1.0, 1.0
"""Standard deviations that leave the motion free, where nothing is declared about the pose."""


_LARGEST_NOISE: Final = 5.0
"""Standard deviations that normal noise of a direction exceeds with a probability of 6e-7. A file of 100 pairs of six
directions has such noise once in 3000 files."""


@dataclass(frozen=True, slots=True)
class DepthPair:
    """A depth frame and the next one whose timestamp advances.

    Attributes
    ----------
    window
        The window that owns the second frame.
    track
        Poses, with the depth camera.
    first, second
        Rows of the depth stream.
    start_ns, end_ns
        Their timestamps, ns from the file's origin.
    motion
        How points move in the camera frame (Z forward, X right, Y down) from the first to the second.
    motion_error
        (6,) bound of the twist by which interpolating the pose between its samples errs, rad and m.
    noise
        (6, k) independent directions of the motion's noise, one standard deviation long; k = 0 where it is exact.
    every_px
        Step between the sampled rows and columns of the frames, px; images and lattices have one value for each.
    """

    window: Window
    track: PoseTrack
    first: int
    second: int
    start_ns: int
    end_ns: int
    motion: RigidMotion
    motion_error: Float64
    noise: Float64
    every_px: int

    @property
    def images(self) -> tuple[DepthImage, DepthImage]:
        """Both frames, prepared for reading between pixels."""
        return image_of(self.window, self.first, self.every_px), self.image1

    @property
    def image1(self) -> DepthImage:
        """The second frame, prepared for reading between pixels."""
        return image_of(self.window, self.second, self.every_px)

    def whole(self) -> "DepthPair":
        """Return the pair with all pixels of its frames."""
        return replace(self, every_px=1)

    def model(self) -> DepthModel:
        """Return camera and motion as the file declares them."""
        # Pixel u of the frame is pixel u / every_px of the sampled one: rows 1 and 2 of K scale alike.
        to_sampled = np.array([[1 / self.every_px], [1 / self.every_px], [1.0]])
        camera = self.track.camera
        return DepthModel(to_sampled * camera.K, self.motion, motion_error=self.motion_error, lens=camera.lens)

    def warped_after(self, fit: DepthFit, lattice: DepthLattice) -> WarpedLattice:
        """Warp pixels of the first frame by the motion of a fit.

        A fit of all directions of the motion removes errors of interpolation and rounding with the noise. The residuals
        may have only what it leaves of them, and what its last step would change; an infinite bound (no pose samples to
        estimate it by) stays infinite.
        """
        model = replace(self.model(), motion=self.motion.corrected(fit.twist))
        if not np.isfinite(self.motion_error).all():
            return warp(model, lattice, self.image1)
        warped = warp(replace(model, motion_error=0.0), lattice, self.image1).allowing(fit.twist_step[:, np.newaxis])
        errors = self.motion_errors()
        return warped.allowing(fit.motion_left @ errors) if errors.any() else warped

    def warped_within_noise(self, lattice: DepthLattice) -> WarpedLattice:
        """Warp pixels of the first frame by the declared motion, with bounds that include its noise."""
        return warp(self.model(), lattice, self.image1).allowing(
            np.hstack((self.rounding_twists(), _LARGEST_NOISE * self.noise))
        )

    def motion_errors(self) -> Float64:
        """Return the largest errors (6, k) of the motion, rad and m, by interpolation and rounding of the poses."""
        return np.hstack((np.diag(self.motion_error), self.rounding_twists()))

    def rounding_covariance(self) -> Float64:
        """Return the covariance (6, 6) of the twist, rad and m, by the steps in which poses are stored.

        A component that was rounded errs uniformly within its bound b, with variance ``b^2 / 3``. A quaternion holds
        half angles.
        """
        position_bounds_m, quaternion_bounds = self._rounding_bounds()
        return self.track.covariance(
            self.start_ns, self.end_ns, float(position_bounds_m.max()) / sqrt(3),
            2 * float(quaternion_bounds.max()) / sqrt(3),
        )  # fmt: skip

    def rounding_twists(self) -> Float64:
        """Return the largest effects (6, k) on the motion, rad and m, of the steps in which poses are stored.

        Poses in double precision have none (k = 0): their rounding is a billionth of that of depths in float32.
        """
        steps = [
            self.window.facts.steps.get(key, StoredStep()) for key in ("path/pose/position", "path/pose/orientation")
        ]
        if not any(step.is_coarse or step.roundoff > DOUBLE_ROUNDOFF for step in steps):
            return np.zeros((6, 0))
        return self.track.rounding_twists(self.start_ns, self.end_ns, *self._rounding_bounds())

    def _rounding_bounds(self) -> tuple[Float64, Float64]:
        """Return the largest errors by rounding of the components of positions (3,), m, and of quaternions (4,)."""
        steps = self.window.facts.steps
        largest_m = float(np.abs(self.track.poses.positions_world_m).max(initial=0.0))
        position, orientation = (steps.get(f"path/pose/{part}", StoredStep()) for part in ("position", "orientation"))
        return (
            np.array([float(position.component(i).error_bounds(largest_m)) for i in range(3)]),
            np.array([float(orientation.component(i).error_bounds(1.0)) for i in range(4)]),
        )

    def scaled(self, factor: float) -> DepthModel:
        """Return the declared model with depths that are too large by a factor."""
        return replace(self.model(), scale=factor)

    def as_rays(self, share: float) -> DepthModel:
        """Return the declared model with depths that are lengths of the ray (1), z (0), or between."""
        return replace(self.model(), ray=share)

    def models_of_path(self) -> Family:
        """Return the models whose positions are too small by a factor, by that factor; None without poses at both ends.

        Interpolation is linear in the positions: the poses are interpolated once, and their positions multiplied.
        """
        (R_start, start_m), (R_end, end_m) = self.track.ends(self.start_ns, self.end_ns)

        def model(factor: float) -> DepthModel | None:
            motion = motion_between((R_start, factor * start_m), (R_end, factor * end_m), self.track.camera)
            return None if motion is None else replace(self.model(), motion=motion)

        return model

    def lattice(self) -> DepthLattice:
        """Return pixels of the first frame, as dense as the effort asks for."""
        return lattice_of_frame(self.window, self.first)

    def lattice_to_fit(self) -> DepthLattice:
        """Return evenly spread pixels of ``lattice``, as many as a parameter is fitted to."""
        return self.lattice().thinned(FIT_PIXELS if self.every_px == 1 else FIT_PIXELS_OF_LARGE)

    def fit_as_declared(self) -> DepthFit | None:
        """Return the fit of the motion within its noise, all else being as declared; made once a window."""
        return self.window.derived(_fit_as_declared, self.first, self.second)


def _fit_as_declared(window: Window, first: int, second: int) -> DepthFit | None:
    pair = pair_between(window, pose_track(window, window.facts.declared.cameras["depth"]), first, second)
    if pair is None:
        return None
    # Pixels are weighted by their own errors: what interpolation may add is an error of the motion, which is fitted.
    model, lattice = replace(pair.model(), motion_error=0.0), pair.lattice_to_fit()
    fit = fit_depth(lambda _: model, lattice, pair.image1, pair.noise, start=0.0, step=None)
    if fit is None or not pair.motion_errors().any():
        return fit
    return replace(fit, typical_bound=pair.warped_after(fit, lattice).typical_bound)


def owned_pairs(window: Window) -> Iterator[DepthPair | None]:
    """Yield the planned pairs whose second frame the window owns; None for a pair that no pose covers."""
    facts = window.facts
    clock = facts.clocks["depth"]
    rows, owned = np.flatnonzero(clock.advancing), window.owned("depth")
    start, stop = np.searchsorted(rows, (owned.start, owned.stop)).tolist()
    # The pair of the first owned frame begins with the last frame of the window before.
    before = max(start - 1, 0)
    track = pose_track(window, facts.declared.cameras["depth"])
    for first, second in pairwise(rows[before:stop].tolist()):
        if all(has_static_depth(window, frame) for frame in (first, second)):
            pair = pair_between(window, track, first, second)
            yield pair
            if pair is not None:
                lattice_of_frame(window, second)  # the next window's first frame


def pair_between(window: Window, track: PoseTrack, first: int, second: int) -> DepthPair | None:
    """Return a pair by its rows; None where no pose covers it or the frame's size is not the camera's.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the motion.
    track
        Poses, with the depth camera.
    first, second
        Rows of the depth stream.

    Returns
    -------
    DepthPair or None
        None where no pose covers an end of the interval.
    """
    times_ns = window.facts.clocks["depth"].times_ns
    start_ns, end_ns = int(times_ns[first]), int(times_ns[second])
    # Only the motion is kept: a pair refers to its window, so a kept pair would keep the window and all its images.
    motion = window.derived(_motion, first, second)
    if motion is None:
        return None
    return DepthPair(window, track, first, second, start_ns, end_ns, *motion, every_px=_every_px(window))


def _motion(window: Window, first: int, second: int) -> tuple[RigidMotion, Float64, Float64] | None:
    """Return motion, motion error and noise of a ``DepthPair``; None where no pose covers it."""
    track = pose_track(window, window.facts.declared.cameras["depth"])
    before, after = (pose_of_frame(window, track, "depth", frame) for frame in (first, second))
    motion = motion_between(before, after, track.camera)
    if motion is None:
        return None
    start_ns, end_ns = window.facts.clocks["depth"].times_ns[[first, second]].tolist()
    noise = window.facts.declared.pose
    sigma_m, sigma_rad = (
        (noise.position_sigma_m, noise.rotation_sigma_rad) if noise else (_FREE_MOTION_M, _FREE_MOTION_RAD)
    )
    exact = sigma_m == sigma_rad == 0.0
    # Exact poses leave the motion no freedom at all.
    covariance = np.zeros((6, 6)) if exact else track.covariance(start_ns, end_ns, sigma_m, sigma_rad)
    return motion, track.interpolation_twist(start_ns, end_ns), noise_directions(covariance)


def lattice_of_frame(window: Window, frame: int) -> DepthLattice:
    """Return the pixels of a frame that are carried to the next one, made once for neighbouring windows.

    Parameters
    ----------
    window
        The share of pixels follows from its sampling.
    frame
        Row of the depth stream.

    Returns
    -------
    DepthLattice
        Depths in m; their relative error is half a step of the stored depths.
    """
    values = window.derived_image(_lattice_values, frame)
    # Rounding to steps errs by half a step at most.
    return DepthLattice(*values).with_relative_error(step_share(window) / 2)


def _lattice_values(window: Window, frame: int) -> Float64:
    every_px = _every_px(window)
    image = image_of(window, frame, every_px)
    height, width = image.depths_m.shape
    return lattice_values(image, lattice_stride(height, width, min(window.sampling.tile_share * every_px, 1.0)))


def pixels_of_pairs(pixels_read: int, pairs: int, facts: Facts) -> Coverage:
    """Return the coverage of the pairs of depth frames by the pixels that were carried from one frame to the other.

    Parameters
    ----------
    pixels_read
        Of all pairs.
    pairs
        Number of pairs of the file, compared or not.
    facts
        With the depth camera.

    Returns
    -------
    Coverage
        Of the pixels of the first frame of each pair; of the pairs where none was compared.
    """
    if not pixels_read:
        return Coverage(0, pairs, "pairs of depth frames")
    camera = facts.declared.cameras["depth"]
    return Coverage(pixels_read, pairs * camera.height * camera.width, "pixels of pairs of depth frames")


def image_of(window: Window, frame: int, every_px: int) -> DepthImage:
    """Return every so many-th row and column of a depth frame prepared for reading, made once a window.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the image.
    frame
        Row of the depth stream.
    every_px
        Step between the sampled rows and columns, px.

    Returns
    -------
    DepthImage
        Static depth in m, prepared for reading between pixels.
    """
    return window.derived(_image_of, frame, every_px)


def _image_of(window: Window, frame: int, every_px: int) -> DepthImage:
    sampled_m = static_depth_of_frame_m(window, frame)[::every_px, ::every_px]
    return depth_image(sampled_m, step_share(window), least_block_px=min(every_px, 2))


def _every_px(window: Window) -> int:
    """Return every how many-th row and column of depth frames is sampled."""
    if window.sampling.tile_share >= 1.0:
        return 1
    camera = window.facts.declared.cameras["depth"]
    # Both axes are thinned alike, so the step is the root of the ratio of the pixel counts.
    return max(1, round(sqrt(camera.height * camera.width / _PIXELS)))


def static_depth_of_frame_m(window: Window, frame: int) -> NDArray[np.float32]:
    """Return the depth of static surfaces in a frame.

    Parameters
    ----------
    frame
        Row of the depth stream.

    Returns
    -------
    ndarray of float32
        (H, W) m; NaN where an object moves by itself, and in all pixels where no mask marks such objects.
    """
    depth_m = static_depth_m(window, frame)
    return np.full_like(window.depth_m(frame), np.nan) if depth_m is None else depth_m


def step_share(window: Window) -> float:
    """Return the largest step of the window's depths as a share of the depth; 0 where they are as fine as float32.

    It is that of the nearest or of the farthest depth of the first frame that the window owns.
    """
    return window.derived(_step_share)


def _step_share(window: Window) -> float:
    owned, step = window.owned("depth"), depth_step_m(window.facts)
    if not step.is_coarse or not owned:
        return 0.0
    extremes = positive_extremes(window.depth_m(owned[0]))
    return 0.0 if extremes is None else largest_share(step, *extremes[:2])


def depth_step_m(facts: Facts) -> StoredStep:
    """Return the step in which depths are stored, in m."""
    return facts.steps.get("path/depth", StoredStep()).scaled(1.0 / MM_PER_M)


def largest_share(step: StoredStep, nearest_m: float, farthest_m: float) -> float:
    """Return the largest step of depths between two of them as a share of the depth: at one of the ends."""
    ends_m = np.array([nearest_m, farthest_m])
    return float(np.max(2 * step.error_bounds(ends_m) / ends_m))


def why_no_geometry(facts: Facts) -> str:
    """Return why depth frames cannot be compared by the declared geometry; empty where they can."""
    camera = facts.declared.cameras.get("depth")
    if camera is None:
        return "the depth camera's intrinsics and mounting are not declared"
    if camera.model != "pinhole":
        return f"the depth camera is declared as {camera.model}; the check needs a pinhole"
    return why_no_static_depth(facts)


def where_of_frames(facts: Facts, first: int, last: int) -> Where:
    """Return where depth frames from the first to the last row (both included) lie in the file.

    Parameters
    ----------
    facts
        With the depth clock.
    first, last
        Rows of the depth stream.

    Returns
    -------
    Where
        Timestamps in microseconds as the file states them.
    """
    times_ns = facts.clocks["depth"].times_ns
    return Where(
        stream="depth",
        start_us=facts.to_file_us(int(times_ns[first])),
        stop_us=facts.to_file_us(int(times_ns[last])),
        index_start=first,
        index_stop=last + 1,
        frame=first,
    )
