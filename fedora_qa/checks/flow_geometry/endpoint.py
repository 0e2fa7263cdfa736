"""Flow against depth and pose: flow recomputed by the equations of the paper."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.flow.parameter_templates import FLOW_GAIN, PARAMETER_TEMPLATES, TIME_OFFSET, sum_of
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_pairs import why_no_geometry
from fedora_qa.views.flow_comparison import (
    FieldError,
    FieldShift,
    FlowParameterFit,
    common_shift,
    compare_field,
    is_noisy,
    shift_of_field,
)
from fedora_qa.views.flow_conventions import ConventionTrial, try_inverse_transforms
from fedora_qa.views.flow_intervals import (
    PoseTrack,
    ends_on_frame,
    frame_at,
    motion_over,
    owned_intervals,
    place,
    pose_track,
)
from fedora_qa.views.pixel_lattice import Region, union_of

_MOST_FOLLOW_UPS: Final = 8

_DETECTABLE: Final = 2.0
"""Least predicted ratio of a fault to its bound at another rate for the fault to be detected there."""

_AFFECTED: Final = 0.1
"""Least excess of an affected field, relative to the typical excess of deviating fields: fields with little motion
deviate less."""

_LINEAR_GAIN: Final = 0.1
"""Largest gain that is fitted where the pose may be corrected: with a larger one the correction follows the gain, and
the template does not apply."""

# A drift of 1 ms/s is 1000 ppm, and lengthens each interval by 0.1%.
_PPM_PER_MS_PER_S, _PERCENT_PER_MS_PER_S = 1e3, 0.1


@dataclass(frozen=True, slots=True)
class WindowErrors:
    """The fields of a window.

    Attributes
    ----------
    window
        Number of the window.
    fields
        Compared fields.
    without_depth
        Number of fields that start or end on no frame.
    without_pose
        Number of fields that no pose covers.
    too_few_pixels
        Number of fields with too few valid pixels.
    trials, shifts
        Trials and fitted shifts of a follow-up.
    """

    window: int
    fields: tuple[FieldError, ...] = ()
    without_depth: int = 0
    without_pose: int = 0
    too_few_pixels: int = 0
    trials: tuple[ConventionTrial, ...] = ()
    shifts: tuple[FieldShift, ...] = ()


@dataclass(frozen=True, slots=True)
class FlowRatesOff(Feature):
    """Rates that deviate.

    Attributes
    ----------
    off
        Whether each rate deviates, or has intervals too short for the fault to exceed its bound there.
    """

    off: Mapping[str, bool]


@dataclass(frozen=True, slots=True)
class FieldsOff(Feature):
    """The deviating fields of one rate.

    Attributes
    ----------
    count
        Number of deviating fields.
    affected_share
        Share of fields with an error of at least ``_AFFECTED`` of the typical one of deviating fields, 0 to 1. Fields
        of correct files have a hundredth of their bounds.
    in_part
        Whether most of them deviate in a rectangle of the image only.
    repeats_of_flow, repeats_of_depth
        Numbers of fields that equal the field before, and of fields whose depth frame equals the one before, bit for
        bit.
    part
        Where most deviate in a part only: left, top, right, bottom, px, of the pixels that deviate in any field. The
        lattices of the fields together have every pixel, so that its edges are those of the fault where the flow
        deviates at them.
    first_ns, last_ns
        Starts of the first and the last field that deviate, ns from the origin.
    """

    count: int
    affected_share: float
    in_part: bool
    repeats_of_flow: int
    repeats_of_depth: int
    part: Region | None = None
    first_ns: int = 0
    last_ns: int = 0


@dataclass(frozen=True, slots=True)
class FlowGainFit(Feature):
    """A gain of all fields of one rate.

    Attributes
    ----------
    gain, standard_error
        Excess of the factor over 1 (0.1 for flow that is 10% too large), and its standard error.
    removed_share
        Share of the rms deviation that the gain removes, 0 to 1.
    correlation
        Correlation of the stored with the recomputed flow; 1 under a gain alone.
    interval_s
        Length of an interval of the rate, s.
    """

    gain: float
    standard_error: float
    removed_share: float
    correlation: float
    interval_s: float


@dataclass(frozen=True, slots=True)
class FreeMotionCorrection(Feature):
    """Effect of an unbounded correction of the relative pose of each deviating field.

    Attributes
    ----------
    removed_share
        Share of the typical rms deviation that the corrections remove, 0 to 1.
    shift_m
        Typical length of the corrections of the position, m.
    growth
        Square of the sum of corrections over their mean square, for rotation or position, whichever is larger.
    """

    removed_share: float
    shift_m: float
    growth: float


@dataclass(frozen=True, slots=True)
class PoseCorrectionRatios(Feature):
    """Corrections of the pose under its declared noise.

    Attributes
    ----------
    of_rate
        Mean square of the corrections over its expectation by rate; 1 where none was tested.
    """

    of_rate: Mapping[str, float]


class FlowGeometryEndpoint(WindowCheck[WindowErrors]):
    """Is the stored flow equal to that of depth, intrinsics and the camera's motion?

    On a lattice of pixels, flow is recomputed from the depth at the interval's start and the relative pose, and
    compared with the stored flow. The endpoint error in px is stated as root mean square and at the worst pixel of each
    rate. With declared pose noise, the size of the pose corrections that fit the flow is stated as well.

    Why it matters
    --------------
    Flow is computed from depth and pose. If they disagree, one of them belongs to another camera, another time, another
    unit or another frame of reference, and every use of two of them together has that error.

    How
    ---
    The density of the lattice depends on the effort; its phase changes from field to field. Flow is recomputed by the
    definition of format.md, X1 = R X0 + t. With declared pose noise, a correction of the relative pose of each field is
    fitted (Gauss-Newton, six parameters). After an alarm, templates of small errors (gain, focal length, principal
    point, mounting, lever arm, time, drift) are fitted to the deviation, a shift of the image by parts of a pixel is
    fitted away from the breaks of the flow, and inverse transforms are applied to deviating fields (sign, axes, units,
    mirrors, shifts, other rates and intervals, ray lengths, quaternion conventions). Where only a part of the image
    deviates, all of this uses that part, with the motion that the rest of the image states, and causes that change the
    whole image are not named. Parameters of the camera that were probably set by hand (a round field of view, a centred
    principal point) are not suspected while flow can be the cause.

    Noise model
    -----------
    Without pose noise only rounding may remain. Its bound for each pixel follows from float32 flow, float32 depth and
    single-precision arithmetic, 1e-4 to 1e-3 px; where timestamps lie between poses, the interpolation error is added.
    With pose noise, only rounding may remain after the correction, and the correction must have the size that the noise
    implies. Its squared Mahalanobis distance, summed over every second field (whose intervals share no pose), is
    chi-square; the cube root of its mean is normal. A correction of zero means that the flow was made from the noisy
    pose.

    Cannot detect
    -------------
    Errors that depth, pose and flow share. The scale of a translation while hovering. Errors of time and mounting that
    are smaller than the declared pose noise, and all such errors where the noise is not declared. Moving objects are
    left out.

    Sources
    -------
    The paper's flow equation x* = K pi(R z K^-1 x + T). Rounding: first principles, ``geometry/rigid_flow.py``.
    Elimination of the pose: Schur's complement, ``estimators/flow/parameter_templates.py``. E. B. Wilson, M. M.
    Hilferty, PNAS 17 (1931) 684.
    """

    name = "flow_geometry.endpoint"
    needs = ("flow", "depth", "pose")

    def not_applicable(self, facts: Facts) -> str:
        """Return which assumption of the model does not hold; empty where all hold."""
        return why_no_geometry(facts)

    def measure(self, window: Window) -> WindowErrors | None:
        """Compare every field that the window owns."""
        track: PoseTrack | None = None
        fields: list[FieldError] = []
        without_depth = without_pose = too_few_pixels = 0
        for stream in window.facts.flow_streams:
            for interval in owned_intervals(window, stream):
                # Poses are read once a window, and only where it owns an interval.
                track = track or pose_track(window, window.facts.declared.cameras["depth"])
                frame = frame_at(window.facts.clocks["depth"], interval.start_ns)
                motion = motion_over(window, interval)
                if frame is None or not ends_on_frame(window.facts, interval):
                    without_depth += 1
                elif motion is None:
                    without_pose += 1
                elif error := compare_field(window, track, interval, frame, motion):
                    fields.append(error)
                else:
                    too_few_pixels += 1
        return WindowErrors(window.span.index, tuple(fields), without_depth, without_pose, too_few_pixels)

    def follow_up_windows(self, state: list[WindowErrors], facts: Facts) -> tuple[int, ...]:
        """Return the windows of the worst fields, the worst first."""
        # Negated, so that the worst window comes first.
        worst = sorted((-_suspicion(errors.fields), errors.window) for errors in state)
        return tuple(window for suspicion, window in worst[:_MOST_FOLLOW_UPS] if suspicion < -1)

    def follow_up(self, state: list[WindowErrors], window: Window) -> None:
        """Try inverse transforms and fit a shift, on the middle one of the window's deviating fields of each rate.

        A fault often begins or ends in the interval of the worst field, so half of that field may be correct.
        """
        track = pose_track(window, window.facts.declared.cameras["depth"])
        fields = [field for errors in state if errors.window == window.span.index for field in errors.fields]
        trials: list[ConventionTrial] = []
        shifts: list[FieldShift] = []
        for stream in window.facts.flow_streams:
            off = [field for field in fields if field.interval.stream == stream and field.suspicion > 1]
            if off:
                chosen = sorted(off, key=lambda field: field.suspicion)[(len(off) - 1) // 2]
                of_field = window, track, chosen.interval, chosen.frame, chosen.region
                trials += try_inverse_transforms(*of_field)
                shifts += filter(None, (shift_of_field(*of_field),))
        state.append(WindowErrors(window.span.index, trials=tuple(trials), shifts=tuple(shifts)))

    def conclude(self, state: Sequence[WindowErrors], facts: Facts) -> Observation:
        """State the endpoint error of each rate, and the size of the corrections."""
        fields = sorted(
            (f for errors in state for f in errors.fields), key=lambda f: (f.interval.stream, f.interval.row)
        )
        trials = [trial for errors in state for trial in errors.trials]
        shifts = [shift for errors in state for shift in errors.shifts]
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        pixels_of_field = max((field.pixels_of_field for field in fields), default=0)
        coverage = Coverage(
            sum(field.pixels_read for field in fields), total * pixels_of_field, "pixels of flow fields"
        )
        if not fields:
            coverage = Coverage(0, total, "flow fields")
            counts = {
                "start or end on no frame": sum(errors.without_depth for errors in state),
                "are not covered by poses": sum(errors.without_pose for errors in state),
                "share too few valid pixels with the depth": sum(errors.too_few_pixels for errors in state),
            }
            reasons = [f"{count} {reason}" for reason, count in counts.items() if count]
            none_why = "of the fields of flow " + ", ".join(reasons) if reasons else "the file has no field of flow"
            return Observation(coverage, unobservable=none_why)
        by_stream = {s: [f for f in fields if f.interval.stream == s] for s in facts.flow_streams}
        by_stream = {stream: group for stream, group in by_stream.items() if group}
        # A rate deviates, or its intervals are too short: a fault of all rates grows with the length of the interval,
        # by the excess per second of the rate that deviates most.
        suspicions = {stream: _suspicion(group) for stream, group in by_stream.items()}
        lengths_s = {stream: group[0].interval.duration_s for stream, group in by_stream.items()}
        growth = max(
            (suspicion / max(lengths_s[stream], 1e-9) for stream, suspicion in suspicions.items() if suspicion > 1),
            default=0.0,
        )
        rates_off = {
            stream: suspicions[stream] > 1 or 0 < growth * lengths_s[stream] <= _DETECTABLE for stream in by_stream
        }
        of_all_rates = (
            FlowRatesOff(rates_off),
            PoseCorrectionRatios({stream: _squares_ratio(group) for stream, group in by_stream.items()}),
        )
        statistics: list[Statistic] = []
        for stream, group in by_stream.items():
            of_rate = (trial for trial in trials if trial.rate == stream)
            shift = common_shift([shift for shift in shifts if shift.rate == stream])
            features = (*of_all_rates, *of_rate, *_features(group, facts), *((shift,) if shift else ()))
            statistics += [replace(statistic, features=features) for statistic in _statistics(stream, group, facts)]
        if facts.declared.pose:
            return Observation(coverage, tuple(statistics))
        undeclared = Notice(
            "flow_geometry.endpoint.undeclared",
            "The noise of the pose is not declared, so that the correction of each field's relative pose has no limit: "
            "errors of time and mounting cannot be detected.",
        )
        return Observation(coverage, tuple(statistics), (undeclared,))


def _statistics(stream: str, fields: Sequence[FieldError], facts: Facts) -> list[Statistic]:
    """State one rate's rms endpoint error, its worst pixel, and, with declared noise, the size of its corrections."""
    pixels = sum(field.pixels for field in fields)
    rms_px = float(np.sqrt(sum(field.squares for field in fields) / pixels))
    bound_px = float(np.sqrt(sum(field.bound_squares for field in fields) / pixels))
    off = [field for field in fields if field.suspicion > 1]
    typical = Statistic(
        name=f"{stream} endpoint_error",
        value=rms_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=bound_px,
        side="upper",
        statement=f"{stream} differs from the flow of depth and pose by {rms_px:.3g} px rms; the bound by rounding is "
        f"{bound_px:.1g} px; {len(off)} of {len(fields)} fields deviate.",
        code="flow_geometry.endpoint.error",
        where=_where(off or fields, facts),
    )
    # By excess over the bound of the pixel, which depends on depth and motion; within the bounds by the ratio.
    field = max(fields, key=lambda f: (max(f.worst_px - f.worst_bound_px, 0.0), f.worst_px / f.worst_bound_px))
    column, row = field.worst_pixel
    worst = Statistic(
        name=f"{stream} worst_endpoint_error",
        value=field.worst_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=field.worst_bound_px,
        side="upper",
        statement=f"Field {field.interval.row} of {stream} differs from the flow of depth and pose by "
        f"{field.worst_px:.3g} px at column {column}, row {row}; the bound by rounding is "
        f"{field.worst_bound_px:.1g} px.",
        code="flow_geometry.endpoint.worst_pixel",
        where=place(facts, (field.interval, field.interval), frame=field.frame, pixel=field.worst_pixel),
    )
    noise, tested = facts.declared.pose, _independent(fields)
    if not noise or not is_noisy(noise) or not tested:
        return [typical, worst]
    # With Q chi-square of n degrees of freedom, (Q/n)^(1/3) is normal about 1 - 2/(9n) with variance 2/(9n) (Wilson and
    # Hilferty, PNAS 17 (1931) 684); at n = 6 its five-sigma tails are right within a factor of three.
    variance = 2 / (9 * sum(field.twist_dof for field in tested))
    ratio = float(np.cbrt(_squares_ratio(fields)))
    correction = Statistic(
        name=f"{stream} pose_correction",
        value=ratio,
        unit="1",
        standard_error=float(np.sqrt(variance)),
        expected=1 - variance,
        # The statistic is the cube root of a ratio of squares; its power 3/2 is the ratio of lengths.
        statement=f"The corrections of the pose that fit {stream} are {ratio**1.5:.3g} times as large as the declared "
        "pose noise implies.",
        code="flow_geometry.endpoint.pose_correction",
        where=_where(tested, facts),
    )
    return [typical, worst, correction]


def _features(fields: Sequence[FieldError], facts: Facts) -> list[Feature]:
    """Return the features of the deviation of one rate: its extent, fits of small errors, and corrections."""
    off = [field for field in fields if field.suspicion > 1]
    typical = float(np.median([field.suspicion for field in off])) if off else np.inf
    regions = [field.region for field in off if field.region is not None]
    in_part = 2 * len(regions) > len(off)
    starts_ns = [field.interval.start_ns for field in off]
    extent = FieldsOff(
        count=len(off),
        affected_share=sum(field.suspicion > _AFFECTED * typical for field in fields) / len(fields),
        in_part=in_part,
        repeats_of_flow=sum(field.repeats == "flow" for field in off),
        repeats_of_depth=sum(field.repeats == "depth" for field in off),
        part=union_of(regions) if in_part else None,
        first_ns=min(starts_ns, default=0),
        last_ns=max(starts_ns, default=0),
    )
    features: list[Feature] = [extent, *_parameter_fits(fields, facts)]
    corrected = [field for field in off if field.free_pixels]
    if corrected:
        remaining = np.median([np.sqrt(field.free_squares / field.free_pixels) for field in corrected])
        stored = np.median([np.sqrt(field.squares / field.pixels) for field in corrected])
        shift_m = float(np.median([np.linalg.norm(field.free_twist[3:]) for field in corrected]))
        removed_share = max(1.0 - float(remaining / stored), 0.0)
        features.append(FreeMotionCorrection(removed_share, shift_m, correction_growth(corrected)))
    return features


def _parameter_fits(fields: Sequence[FieldError], facts: Facts) -> list[Feature]:
    """Fit each template alone to all fields together, and an offset of timestamps that grows from the file's origin."""
    measured = [(field, field.evidence) for field in fields if field.evidence]
    if not measured:
        return []
    total = sum_of([evidence for _, evidence in measured])
    fits: list[Feature] = []
    for template in PARAMETER_TEMPLATES:
        sizes, removed_share, error = total.fit(template.columns)
        # A template is the derivative of the flow: beyond this size it is no longer the change of the flow.
        if np.abs(sizes).max() > template.largest:
            continue
        if template is FLOW_GAIN:
            # The gain's template is 1% of the flow.
            gain = 0.01 * float(sizes[0])
            if not (is_noisy(facts.declared.pose) and abs(gain) > _LINEAR_GAIN):
                # 100^2 times the square of the template is the sum of squares of the recomputed flow.
                recomputed = float(total.matrix[template.columns.start, template.columns.start]) * 100.0**2
                correlation = 1.0
                # Where it is 0, corrections of the poses have the effect of a gain. Where the recomputed flow is far
                # too large, a gain of -100% removes nearly all of the deviation without being its cause. Where
                # only rounding remains, a flow of zero is also a gain.
                if not recomputed <= 0:
                    common = (1 + gain) ** 2 * recomputed
                    remaining = max(total.total - gain**2 * recomputed, 0.0)
                    # r^2 = common / (common + remaining).
                    correlation = float(np.sqrt(min((common + total.count) / max(remaining + common, 1.0), 1.0)))
                interval_s = fields[0].interval.duration_s
                fits.append(FlowGainFit(gain, 0.01 * error, removed_share, correlation, interval_s))
        else:
            size = template.size(sizes)
            components = tuple(float(component) for component in sizes)
            fits.append(FlowParameterFit(template.parameter, size, template.unit, error, removed_share, components))
    # A drift offsets an interval by its rate times the middle, and makes it too long or too short, which is a gain.
    drifting = []
    for field, evidence in measured:
        direction = np.zeros(len(evidence.vector))
        direction[TIME_OFFSET.columns] = (field.interval.start_ns + field.interval.end_ns) / (2 * NS_PER_S)
        direction[FLOW_GAIN.columns] = _PERCENT_PER_MS_PER_S
        drifting.append(evidence.along(direction))
    ms_per_s, removed_share, error = sum_of(drifting).fit(slice(None))
    last_s = max(field.interval.end_ns for field, _ in measured) / NS_PER_S
    # At the end of the file the drift's offset must still lie within the template of an offset.
    if not abs(ms_per_s[0]) * last_s > TIME_OFFSET.largest:
        ppm, error_ppm = _PPM_PER_MS_PER_S * float(ms_per_s[0]), _PPM_PER_MS_PER_S * error
        fits.append(FlowParameterFit("clock_rate", ppm, "ppm", error_ppm, removed_share))
    return fits


def correction_growth(fields: Sequence[FieldError]) -> float:
    """Return the square of the sum of the fields' corrections over their mean square, the larger of both parts.

    Each field ends at the pose at which the next begins, so pose noise cancels in the sum: the sum is as large as one
    correction, for any number of fields. Corrections by another motion add up.
    """

    def growth(corrections: NDArray[np.float64]) -> float:
        square = float(np.mean(np.sum(corrections**2, axis=1)))
        return float(np.sum(corrections.sum(axis=0) ** 2)) / square if square > 0 else 0.0

    twists = np.array([field.free_twist for field in fields if field.free_twist])
    return max(growth(twists[:, :3]), growth(twists[:, 3:])) if len(twists) else 0.0


def _independent(fields: Sequence[FieldError]) -> list[FieldError]:
    """Return every second field of those that were compared with the noise: their intervals share no pose."""
    return [field for field in fields if field.twist_dof > 0 and field.interval.row % 2 == 0]


def _squares_ratio(fields: Sequence[FieldError]) -> float:
    """Return the squared corrections over their expectation; 1 where none was tested."""
    tested = _independent(fields)
    dof = sum(field.twist_dof for field in tested)
    return sum(field.twist_chi2 for field in tested) / dof if dof > 0 else 1.0


def _where(fields: Sequence[FieldError], facts: Facts) -> Where:
    worst = max(fields, key=lambda field: field.suspicion)
    return place(facts, (fields[0].interval, fields[-1].interval), frame=worst.frame, pixel=worst.worst_pixel)


def _suspicion(fields: Sequence[FieldError]) -> float:
    return max((field.suspicion for field in fields), default=0.0)
