"""Continuity of the motion of poses, and the transforms under which a jump is continuous."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.pose.orientation import length_bound
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.fitting.robust import sensitivity_range
from fedora_qa.estimators.imu.conventions import signed_permutations
from fedora_qa.estimators.imu.jumps import StepEstimates, find_steps, most_precise_steps
from fedora_qa.estimators.imu.repeated_samples import repeated_samples
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, SampledCurve, VectorSamples
from fedora_qa.estimators.imu.white_noise import noise_level
from fedora_qa.features import Feature
from fedora_qa.geometry import so3
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import PoseSamples, Window
from fedora_qa.views.motion_samples import (
    NOISE_ORDER,
    join_poses,
    location_of,
    owned_poses,
    position_floor_m,
    rotation_floor_rad,
    stored_resolution,
    why_unusable,
)
from fedora_qa.views.sample_defect_detection import (
    LEAST_EVENNESS,
    frozen_poses,
    interpolations_of,
    rate_hz,
    timestamp_defects,
)
from fedora_qa.views.sample_defects import LinearInterpolation, PoseValues

Float64 = NDArray[np.float64]

_STEP_FILTERS: Final = ((4, 5), (6, 7), (8, 5), (12, 5), (24, 5), (12, 3), (24, 3))
"""Half width and degree of the filters that detect jumps: short ones for exact poses, long ones for noisy poses."""

_WIDEST_REACH: Final = _STEP_FILTERS[-1][0]
"""Number of poses on either side of a jump from which its size is estimated, at most."""

_FEWEST_POSES: Final = 24

_PAIR_SIGMAS: Final = 5.0
"""Standard errors by which the sum of two jumps must differ from 0 in the world's axes, for jumps that cancel in the
body's axes."""

_BODY_RATIO: Final = 0.2
"""Largest ratio of their sum in the body's axes to that in the world's: the motion adds to the jumps of exact poses."""

_CAPTURE_RATIO: Final = 0.02
"""Largest ratio of deviation to jump for a transform. By chance one of the 48 transforms is so close in one of 2000
jumps: four times the square of the ratio is the share of the sphere, a twentieth that of lengths."""

_NOISY_CAPTURE_RATIO: Final = 0.1
"""Largest such ratio with noise. By chance one transform of a quaternion is so close in one of ten jumps, and one of a
position in one of three; with a larger ratio a transform has no meaning."""

_NOISE_SIGMAS: Final = 3.0 * 6.0**0.5
"""Three sigma, on each axis, of a pose against the straight line through the two before it: weights 1, -2, 1."""

_INTERPOLATED: Final[Mapping[PoseValues, tuple[str, str]]] = MappingProxyType(
    {
        "positions": ("curvature_evenness", "Positions lie on straight lines"),
        "orientations": ("rotation_evenness", "Orientations turn evenly about one axis"),
    }
)
"""Name of the measurement, and what samples do that were interpolated."""

# Quaternions x, y, z, w: half a turn about (1, 1, 0) / sqrt(2) exchanges east and north and reverses up; half a turn
# about x reverses left and up.
_ROOT_HALF: Final = float(np.sqrt(0.5))
_NED_FROM_ENU: Final = np.array([_ROOT_HALF, _ROOT_HALF, 0.0, 0.0])
_FLU_FROM_FRD: Final = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class PoseJump(Feature):
    """A jump between two poses.

    Attributes
    ----------
    beside_repeated_samples
        Whether its estimate depends on poses that equal the one before, or whose position or orientation does.
    beside_wrong_lengths
        Whether it is one of the orientation, and depends on quaternions of wrong length where most are of unit length.
    """

    beside_repeated_samples: bool
    beside_wrong_lengths: bool = False


@dataclass(frozen=True, slots=True)
class DisplacedPositions(Feature):
    """Positions are displaced from a jump on, to another jump that undoes it in the world or to the end.

    Attributes
    ----------
    displacement_m
        (3,) in the world, m.
    start_ns, stop_ns
        Of the first displaced pose and of the first one behind, ns from the file's origin; infinite without one.
    """

    displacement_m: tuple[float, float, float]
    start_ns: float
    stop_ns: float


@dataclass(frozen=True, slots=True)
class PartBetweenJumps(Feature):
    """Poses of a part of the sequence between two jumps, or between one and an end of the sequence.

    Attributes
    ----------
    start_ns, stop_ns
        Of the first pose of the part and of the first one behind, ns from the file's origin; infinite at an end.
    begins
        Whether the part begins with the stated jump, across which transforms are tried. If not, it ends with it.
    """

    start_ns: float
    stop_ns: float
    begins: bool


@dataclass(frozen=True, slots=True)
class PairedSteps(Feature):
    """Two jumps of the position that cancel in the axes of the body and not in those of the world.

    Attributes
    ----------
    arm_body_m
        (3,) vector in the body by which positions are displaced between the jumps, m.
    standard_error_m
        Of its length, m.
    start_ns, stop_ns
        Of the first displaced pose and of the first one behind, ns from the file's origin.
    """

    arm_body_m: tuple[float, float, float]
    standard_error_m: float
    start_ns: float
    stop_ns: float


@dataclass(frozen=True, slots=True)
class PoseTransform(Feature):
    """A transform of the poses after a jump under which they continue those before it.

    Attributes
    ----------
    kind
        ``length_unit`` (another than before the jump), ``axes`` (exchanged or reversed), ``component_order`` (w first
        against w last), ``inverse`` (of the rotation), ``north_east_down`` (world and body).
    axes
        Rows of the signed permutation, of ``axes`` only.
    factor
        Lengths behind the jump over those before it, of ``length_unit`` only.
    """

    kind: Literal["length_unit", "axes", "component_order", "inverse", "north_east_down"]
    axes: tuple[tuple[int, ...], ...] = ()
    factor: float = 1.0


class PoseContinuity(WindowCheck[PoseSamples]):
    """Is the motion of the poses continuous, without jumps, frozen poses or straight lines?

    The largest jump of position (m) and of orientation (deg) between two poses, the number of frozen poses, and the
    evenness of the curvature of positions, and of orientations, over the poses.

    Why it matters
    --------------
    A reset of the simulator or a loop closure moves the body by millimetres within 5 ms: flow and depth that are warped
    across it are wrong, and velocities are impossible. Poses that are interpolated from a lower rate lack the motion
    between their knots.

    How
    ---
    *Jumps*: at every position, a polynomial plus a step is fitted to the surrounding poses by least squares (the
    matched filter of a step). Of several widths and degrees, the one with the smallest error in this file is used.
    *Frozen poses*: poses that equal the one before in every bit while the body moves. *Straight lines*: the ratio of
    the median curvature between every n-th pose to that at every n-th pose, n from 2 to 20. It is 1 for any smooth or
    noisy motion, and near 0 for linear interpolation; the limit is 0.2. Orientations are interpolated linearly where
    the body turns evenly about one axis (slerp). Of exact poses also the longest part in which three straight lines of
    equal lengths, within rounding, follow each other. Values in coarse steps are straight and bend by a step as well:
    only larger bends count.

    Noise model
    -----------
    White noise with the larger of the declared and the measured sigma (``pose.noise``), and at least that of rounded
    timestamps (speed times 0.29 us) and stored digits. The gain of the filter converts it to the error of a jump. A
    polynomial of two degrees less leaves more motion in the estimate: where the two differ by more than noise, the
    difference is the model error bound at that position. A vibration passes both degrees: where the residuals of the
    fit exceed noise at most positions nearby, their norm times the filter's largest ratio of jump to residual over the
    frequencies is the bound. Each position and axis counts as a test.

    Cannot detect
    -------------
    Jumps below about seven times the filtered noise: about 28 mm in poses with 5 mm of noise, 3 um in exact ones.
    Interpolation by smooth curves, or under noise that hides its kinks (``pose.noise`` detects noise that is then too
    small or too large). A jump that is spread over many poses. A jump that is smaller than a vibration of the body.

    Sources
    -------
    G. Turin, An introduction to matched filters, IRE Trans. IT-6 (1960) 311; first principles in
    ``fedora_qa/estimators/imu/jumps.py``.
    """

    name = "pose.continuity"
    needs = ("pose",)

    def measure(self, window: Window) -> PoseSamples | None:
        """Keep the window's own poses."""
        return owned_poses(window)

    def conclude(self, state: Sequence[PoseSamples], facts: Facts) -> Observation:
        """Detect jumps, stops and straight lines in the whole sequence."""
        poses = join_poses(state)
        coverage = Coverage(len(poses.times_ns), len(facts.clocks["pose"].times_ns), "poses")
        unusable = why_unusable(facts, "pose")
        if unusable or len(poses.times_ns) < _FEWEST_POSES:
            return Observation(coverage, unobservable=unusable or f"fewer than {_FEWEST_POSES} poses")
        frozen_rows, of_timestamps = frozen_poses(poses), timestamp_defects(facts, "pose")
        odd_rows = _rows_of_wrong_length(poses.orientations_xyzw, facts)
        values_of_kind = {"position": poses.positions_world_m, "rotation": poses.orientations_xyzw}
        model = facts.declared.pose or PoseModel()
        measurements: list[Statistic] = []
        kinds: tuple[tuple[str, str, float, SampledCurve], ...] = (
            ("position", "m", 1.0, VectorSamples(poses.positions_world_m)),
            ("rotation", "deg", float(np.degrees(1)), OrientationSamples(poses.orientations_xyzw)),
        )
        # Rounded timestamps and stored digits are the least noise: below it each rounding of exact poses would be a
        # jump.
        least_sigmas = (
            max(model.position_sigma_m, position_floor_m(poses)),
            max(model.rotation_sigma_rad, rotation_floor_rad(poses)),
        )
        for (name, unit, factor, curve), least_sigma in zip(kinds, least_sigmas, strict=True):
            level = noise_level(poses.times_ns, curve, order=NOISE_ORDER)
            sigma = max(least_sigma, 0.0 if level is None else level.sigma)
            # Of the matched filters that are short enough for the file, the most precise.
            candidates = [
                find_steps(poses.times_ns, curve, half_width=width, degree=degree, sigma=sigma)
                for width, degree in _STEP_FILTERS
                if 4 * width <= len(poses.times_ns)
            ]
            steps = most_precise_steps(candidates, sigma)
            if not len(steps.before):
                continue
            # The worst place and axis: most standard errors beyond the bound by motion.
            errors = sigma * steps.gains
            excess = (np.abs(steps.sizes) - steps.motion[:, None]) / errors[:, None]
            row, axis = (int(index) for index in np.unravel_index(np.argmax(excess), excess.shape))
            size, before = factor * float(steps.sizes[row, axis]), int(steps.before[row])
            transforms: tuple[Feature, ...]
            partner = _partner(steps, sigma, row)
            if name == "position":
                transforms = (
                    *position_transforms(poses, before, sigma),
                    *_vectors_of_part(poses, steps, least_sigma, sigma, row, partner),
                )
            else:
                transforms = orientation_transforms(poses, before, sigma)
            transforms = (*transforms, *_parts_between_jumps(poses, steps, row, partner))
            # Samples that repeat within the filter's reach have the effect of a jump: poses, or what jumps of them.
            values = values_of_kind[name]
            held_rows = repeated_samples(values, roundings=[stored_resolution(values)])
            beside_repeats = bool(np.any(np.abs(np.union1d(frozen_rows, held_rows) - before) <= _WIDEST_REACH))
            beside_lengths = name == "rotation" and bool(np.any(np.abs(odd_rows - before) <= _WIDEST_REACH))
            measurements.append(
                Statistic(
                    name=f"{name}_jump",
                    value=size,
                    unit=unit,
                    standard_error=factor * float(errors[row]),
                    model_error_bound=factor * float(steps.motion[row]),
                    # Each place and axis is a separate comparison.
                    tests=steps.sizes.size,
                    sensitivity=sensitivity_range(factor * errors, factor * steps.motion[:, None]),
                    statement=f"The {name} jumps by {abs(size):.4g} {unit} within one step.",
                    code=f"pose.continuity.{name}",
                    where=location_of(facts, "pose", int(poses.times_ns[before]), int(poses.times_ns[before + 1])),
                    features=(*of_timestamps, *transforms, PoseJump(beside_repeats, beside_lengths)),
                )
            )

        measurements.append(
            count_of_faults(
                "frozen",
                len(frozen_rows),
                "poses",
                statement=f"{len(frozen_rows)} poses equal the one before exactly while the body moves.",
                code="pose.continuity.frozen",
                where=location_of(facts, "pose", int(poses.times_ns[frozen_rows[0]]))
                if len(frozen_rows)
                else Where(stream="pose"),
            )
        )

        own_hz = rate_hz(poses)
        for interpolated, interpolation in interpolations_of(poses).items():
            name, relation = _INTERPOLATED[interpolated]
            knots_hz = own_hz / interpolation.stride
            first, last = interpolation.rows or (0, -1)
            measurements.append(
                Statistic(
                    name=name,
                    value=interpolation.evenness,
                    unit="1",
                    standard_error=0.0,
                    expected=1.0,
                    model_error_bound=1.0 - LEAST_EVENNESS,
                    side="lower",
                    statement=f"{relation} between poses {interpolation.stride} apart: they are interpolated from "
                    f"{knots_hz:.4g} to {own_hz:.4g} Hz.",
                    code="pose.continuity.interpolated",
                    where=location_of(facts, "pose", int(poses.times_ns[first]), int(poses.times_ns[last])),
                    features=(*of_timestamps, LinearInterpolation("pose", knots_hz)),
                )
            )
        return Observation(coverage, tuple(measurements))


def _rows_of_wrong_length(orientations_xyzw: Float64, facts: Facts) -> NDArray[np.intp]:
    """Return the indices of quaternions (P, 4) that are not of unit length; none where most are not.

    Components of which some are wrong give another length and another rotation. A length that all share gives none.
    """
    errors = np.abs(np.linalg.norm(orientations_xyzw, axis=1) - 1.0)
    rows = np.flatnonzero(errors > length_bound(facts, stored_resolution(orientations_xyzw)).of_rounding)
    return rows if 2 * len(rows) <= len(errors) else rows[:0]


def _partner(steps: StepEstimates, sigma_m: float, row: int) -> int | None:
    """Return the largest jump, beyond the filter's reach from another, that exceeds noise and motion; None without."""
    sizes_m, bounds_m = np.linalg.norm(steps.sizes, axis=1), _PAIR_SIGMAS * sigma_m * steps.gains + steps.motion
    separate = np.abs(steps.before - steps.before[row]) > steps.reach
    excess_m = np.where(separate & (sizes_m > bounds_m), sizes_m - bounds_m, -np.inf)
    partner = int(np.argmax(excess_m))
    return partner if np.isfinite(excess_m[partner]) else None


def _parts_between_jumps(
    poses: PoseSamples, steps: StepEstimates, row: int, partner: int | None
) -> tuple[PartBetweenJumps, ...]:
    """Return the part between a jump and its partner; without one those before and behind the jump."""
    behind = steps.before[row] + 1
    if partner is None:
        behind_ns = float(poses.times_ns[behind])
        return (PartBetweenJumps(behind_ns, np.inf, True), PartBetweenJumps(-np.inf, behind_ns, False))
    first, stop = sorted((behind, steps.before[partner] + 1))
    return (PartBetweenJumps(float(poses.times_ns[first]), float(poses.times_ns[stop]), bool(behind == first)),)


def _vectors_of_part(
    poses: PoseSamples, steps: StepEstimates, least_sigma_m: float, sigma_m: float, row: int, partner: int | None
) -> tuple[Feature, ...]:
    """Return the vector by which positions are displaced between a jump and its partner, in the body or the world."""
    if partner is None:
        return _displaced_to_end(poses, steps, row)
    rows = np.array(sorted((row, partner)))
    pair, sigma_m = _estimated_again(poses, steps, rows, least_sigma_m, sigma_m)
    return *_paired_steps(poses, pair, sigma_m), *_displaced_positions(poses, pair, sigma_m)


def _estimated_again(
    poses: PoseSamples, steps: StepEstimates, rows: NDArray[np.intp], least_sigma_m: float, sigma_m: float
) -> tuple[StepEstimates, float]:
    """Return two jumps by the filter that is most precise in the noise of poses between which none is, and that noise.

    The jumps themselves are in the noise of the whole, of which the filter was chosen.
    """
    pair = StepEstimates(steps.before[rows], steps.sizes[rows], steps.gains[rows], steps.motion[rows], steps.reach)
    edges = (0, *(pair.before + 1), len(poses.times_ns))
    levels = [
        level.sigma
        for first, stop in pairwise(edges)
        if stop - first >= _FEWEST_POSES
        and (level := noise_level(poses.times_ns[first:stop], VectorSamples(poses.positions_world_m[first:stop]),
                                  order=NOISE_ORDER)) is not None
    ]  # fmt: skip
    own_sigma_m = max(least_sigma_m, min(levels, default=sigma_m))
    curve = VectorSamples(poses.positions_world_m)
    for width, degree in _STEP_FILTERS:
        if 4 * width > len(poses.times_ns):
            continue
        steps_of_width = find_steps(poses.times_ns, curve, half_width=width, degree=degree, sigma=own_sigma_m)
        places = np.searchsorted(steps_of_width.before, pair.before)
        if np.any(places >= len(steps_of_width.before)) or not np.array_equal(
            steps_of_width.before[places], pair.before
        ):
            continue
        other = StepEstimates(
            pair.before,
            steps_of_width.sizes[places],
            steps_of_width.gains[places],
            steps_of_width.motion[places],
            steps_of_width.reach,
        )
        pair = most_precise_steps((pair, other), own_sigma_m)
    return pair, own_sigma_m


def _displaced_to_end(poses: PoseSamples, steps: StepEstimates, row: int) -> tuple[DisplacedPositions, ...]:
    """Return the displacement of all poses behind a jump, or up to a return too near to the end to be estimated."""
    step_m = steps.sizes[row]
    # Behind the last place at which a jump is estimated, a step is a return if it is nearer to one than to none.
    behind = int(steps.before[-1])
    turns_m = np.diff(poses.positions_world_m[behind:], 2, axis=0)
    short_m = np.linalg.norm(turns_m + step_m, axis=1) - np.linalg.norm(turns_m, axis=1)
    back = int(np.argmin(short_m)) if len(short_m) else 0
    returns = len(short_m) > 0 and short_m[back] < 0
    x_m, y_m, z_m = (float(value) for value in step_m)
    stop_ns = float(poses.times_ns[behind + back + 2]) if returns else np.inf
    return (DisplacedPositions((x_m, y_m, z_m), float(poses.times_ns[steps.before[row] + 1]), stop_ns),)


def _displaced_positions(poses: PoseSamples, pair: StepEstimates, sigma_m: float) -> tuple[DisplacedPositions, ...]:
    """Return the displacement that a jump begins, and another one ends; none where they do not cancel."""
    first_m, second_m = pair.sizes
    noise_m = _PAIR_SIGMAS * sigma_m * float(np.linalg.norm(pair.gains))
    if float(np.abs(first_m + second_m).max()) > noise_m + float(pair.motion.sum()):
        return ()
    # Both measured the displacement.
    x_m, y_m, z_m = (float(value) for value in (first_m - second_m) / 2)
    start_ns, stop_ns = (float(time_ns) for time_ns in poses.times_ns[pair.before + 1])
    return (DisplacedPositions((x_m, y_m, z_m), start_ns, stop_ns),)


def _paired_steps(poses: PoseSamples, pair: StepEstimates, sigma_m: float) -> tuple[PairedSteps, ...]:
    """Return the jump that cancels another one in the axes of the body.

    A point l of the body lies ``R_world_body l`` from its origin. Positions of that point during a part of the sequence
    jump by ``R l`` at its start and by ``-R' l`` at its end. The two jumps cancel in the axes of the body; they cancel
    in those of the world only if the body has not turned between them, and then a shifted origin has the same effect.
    """
    # R^T rotates each jump into the axes of the body. A jump lies half a step from the pose on either side: of the
    # first pose of the part and of its last one, the turns of that half step cancel in the mean.
    jumps_m, errors_m = pair.sizes, sigma_m * pair.gains
    edges = np.array([pair.before[0] + 1, pair.before[1]])
    R_world_body = so3.matrices_from_quaternions(so3.normalise(poses.orientations_xyzw[edges]))
    first_body_m, second_body_m = np.einsum("nji,nj->ni", R_world_body, jumps_m)
    sum_body_m = float(np.abs(first_body_m + second_body_m).max())
    sum_world_m = float(np.abs(jumps_m.sum(axis=0)).max())
    noise_m = _PAIR_SIGMAS * float(np.linalg.norm(errors_m))
    # Steps that cancel in the world may be a shifted origin; steps that do not cancel in the body are no lever arm.
    if sum_world_m <= noise_m or sum_body_m > max(noise_m, _BODY_RATIO * sum_world_m):
        return ()
    # l and -l were measured: their mean halves the variance.
    x_m, y_m, z_m = (float(value) for value in (first_body_m - second_body_m) / 2)
    start_ns, stop_ns = (float(time_ns) for time_ns in poses.times_ns[pair.before + 1])
    return (PairedSteps((x_m, y_m, z_m), float(np.linalg.norm(errors_m)) / 2, start_ns, stop_ns),)


def position_transforms(poses: PoseSamples, before: int, sigma_m: float) -> tuple[PoseTransform, ...]:
    """Return the transforms under which the position continues across a jump, within noise.

    Parameters
    ----------
    poses
        Of the whole sequence.
    before
        Index of the last pose before the jump.
    sigma_m
        Noise of the positions on each axis, m.

    Returns
    -------
    tuple
        Transforms within the capture range; empty where the position continues under none.
    """
    positions_m = poses.positions_world_m
    # Linear extrapolation of the two positions before the jump.
    expected_m = positions_m[before] + (positions_m[before] - positions_m[before - 1] if before else 0.0)
    measured_m = positions_m[before + 1]
    # Into the part with another unit, or out of it: x = k x_expected, with k by least squares. A jump of the body gives
    # some k as well, which is the ratio of no two units.
    squared_m2 = float(expected_m @ expected_m)
    factor = float(measured_m @ expected_m) / squared_m2 if squared_m2 > 0 else 1.0
    transformed = [(factor * expected_m, PoseTransform("length_unit", factor=factor))] if factor > 0 else []
    identity = tuple(tuple(int(value) for value in row) for row in np.eye(3))
    transformed += [
        (np.array(axes) @ expected_m, PoseTransform("axes", axes)) for axes in signed_permutations() if axes != identity
    ]
    deviations_m = (
        (float(np.linalg.norm(position_m - measured_m)), transform) for position_m, transform in transformed
    )
    return _nearest(deviations_m, jump=float(np.linalg.norm(measured_m - expected_m)), sigma=sigma_m)


def orientation_transforms(poses: PoseSamples, before: int, sigma_rad: float) -> tuple[PoseTransform, ...]:
    """Return the transforms under which the orientation continues across a jump, within noise.

    Parameters
    ----------
    poses
        Of the whole sequence.
    before
        Index of the last pose before the jump.
    sigma_rad
        Noise of the orientations about each axis, rad.

    Returns
    -------
    tuple
        Transforms within the capture range; empty where the orientation continues under none.
    """
    q = so3.normalise(poses.orientations_xyzw)
    # Extrapolation by the rotation between the two orientations before the jump.
    turn = so3.compose(so3.inverse(q[before - 1]), q[before]) if before else np.array([0.0, 0.0, 0.0, 1.0])
    expected, measured = so3.compose(q[before], turn), q[before + 1]
    # Each transform and its inverse. Components are stored with w first in place of last, or the reverse.
    transformed = [(expected[order], PoseTransform("component_order")) for order in ([3, 0, 1, 2], [1, 2, 3, 0])]
    transformed.append((so3.inverse(expected), PoseTransform("inverse")))
    # q' = q_ned_enu * q * q_frd_flu: both the world's and the body's axes are exchanged.
    north_east_down = so3.compose(so3.compose(_NED_FROM_ENU, expected), _FLU_FROM_FRD)
    transformed.append((north_east_down, PoseTransform("north_east_down")))
    deviations_rad = ((_angle_rad(orientation, measured), transform) for orientation, transform in transformed)
    return _nearest(deviations_rad, jump=_angle_rad(expected, measured), sigma=sigma_rad)


def _nearest(
    deviations: Iterable[tuple[float, PoseTransform]], *, jump: float, sigma: float
) -> tuple[PoseTransform, ...]:
    """Return the transforms within the capture range, and of several those within twice the least deviation."""
    # A fixed share of the jump for exact poses; noise widens it, to a tenth of the jump at most.
    capture_range = max(_CAPTURE_RATIO * jump, min(_NOISE_SIGMAS * sigma, _NOISY_CAPTURE_RATIO * jump))
    captured = [(deviation, transform) for deviation, transform in deviations if deviation <= capture_range]
    least = min((deviation for deviation, _ in captured), default=0.0)
    return tuple(transform for deviation, transform in captured if deviation <= 2 * least or len(captured) == 1)


def _angle_rad(first: Float64, second: Float64) -> float:
    return float(np.linalg.norm(so3.log_quaternion(so3.compose(so3.inverse(first), second))))
