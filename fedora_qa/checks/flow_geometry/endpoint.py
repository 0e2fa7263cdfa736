"""Flow against depth and pose: the paper's own equations, recomputed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.flow_geometry.geometry_suspects import geometry_suspects
from fedora_qa.checks.protocol import ANY_CAUSE, Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_motion import motion_over
from fedora_qa.views.flow_comparison import FieldError, compare_field, is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial, weigh_hypotheses
from fedora_qa.views.flow_intervals import PoseTrack, ends_on_frame, frame_at, owned_intervals, place, pose_track
from fedora_qa.views.flow_suspects import spreads_over
from fedora_qa.views.static_depth import why_not_told_apart

_CLOSER_LOOKS: Final = 8

_SHOWN: Final = 2.0
"""Times its bound by which a fault must exceed it in proportion to be surely seen at another rate."""

_UNMOVED: Final = 0.01
"""Squared corrections below this share of their expectation are none: the flow knows the noise."""

_MATTERS_PX: Final = 0.1
"""An endpoint error that no use of the flow would notice."""


@dataclass(frozen=True, slots=True)
class WindowErrors:
    """The fields that a window owns, how many of them could not be compared, and what a closer look showed."""

    window: int
    fields: tuple[FieldError, ...] = ()
    without_depth: int = 0
    without_pose: int = 0
    too_few_pixels: int = 0
    weighed: tuple[ConventionTrial, ...] = ()


class FlowGeometryEndpoint(WindowCheck[WindowErrors]):
    """Is the stored flow what depth, intrinsics and the camera's motion give?

    On a lattice of pixels the flow is recomputed from the depth at the interval's start and the relative pose, and
    compared with what is stored: the endpoint error in px, as root mean square and at the worst pixel of each rate;
    with declared pose noise also how large the corrections of the pose are that the flow asks for.

    Why it matters
    --------------
    Flow, depth and pose are made from one another. Where they disagree, one of them belongs to another camera,
    another instant, another unit or another frame of reference, and whoever uses two of them together inherits that.

    How
    ---
    The effort states the lattice's density; its phase changes from field to field. The recomputation is format.md's
    own definition, X1 = R X0 + t. With declared pose noise each field may correct its relative pose (Gauss-Newton
    over six numbers). After an alarm, templates of small faults (gain, focal length, principal point, mounting, lever
    arm, time, drift) are fitted to what disagrees, and inverse transforms are tried on fields that are off (sign, axes,
    units, mirrors, shifts, other rates and intervals, ray lengths, quaternion conventions). Where only a part of the
    image is off, all of that is done with this part, and causes that spoil the whole image are not named. Numbers of
    the camera that look chosen (a round field of view, a centred principal point) are not blamed while flow could be.

    Noise model
    -----------
    Without pose noise nothing but rounding may remain: a bound for each pixel from float32 flow, float32 depth and
    single-precision arithmetic, 1e-4 to 1e-3 px; where stamps fall between poses, the interpolation's own error is
    added. With pose noise what remains after the correction must be rounding again, and the correction must be as
    large as the noise makes it: its Mahalanobis square over every second field (whose intervals share no pose) is
    chi-square; the cube root of its mean is normal. A correction of zero means that the flow was made from the noisy
    pose.

    Cannot see
    ----------
    Faults that depth, pose and flow share; the scale of a translation while hovering; faults of time and mounting
    that are smaller than the declared pose noise, and any where noise is not declared. What moves by itself is left
    out.

    Sources
    -------
    The paper's flow equation x* = K pi(R z K^-1 x + T). Rounding: first principles, `geometry/rigid_flow.py`.
    Elimination of the pose: Schur's complement, `estimators/flow/motion_fit.py`. E. B. Wilson, M. M. Hilferty, PNAS
    17 (1931) 684.
    """

    name = "flow_geometry.endpoint"
    needs = ("flow", "depth", "pose")

    def not_applicable(self, facts: Facts) -> str:
        """Say what of the model does not hold."""
        camera = facts.declared.cameras.get("depth")
        if camera is None:
            return "the depth camera's intrinsics and mounting are not declared"
        if camera.model != "pinhole":
            return f"the depth camera is declared as {camera.model}, and only a pinhole is modelled"
        return why_not_told_apart(facts)

    def measure(self, window: Window) -> WindowErrors | None:
        """Compare every field that the window owns."""
        track: PoseTrack | None = None
        fields: list[FieldError] = []
        without_depth = without_pose = too_few_pixels = 0
        for stream in window.facts.flow_streams:
            for interval in owned_intervals(window, stream):
                track = track or pose_track(window, window.facts.declared.cameras["depth"])
                frame = frame_at(window.facts.clocks["depth"], interval.start_ns)
                motion = motion_over(window, track, interval)
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
        """Ask for the windows of the worst fields, the worst first."""
        worst = sorted((-_suspicion(errors.fields), errors.window) for errors in state)
        return tuple(window for suspicion, window in worst[:_CLOSER_LOOKS] if suspicion < -1)

    def follow_up(self, state: list[WindowErrors], window: Window) -> None:
        """Try inverse transforms on a field of each rate: the middle one of those that the window has off.

        The worst is often one in whose interval a fault begins or ends, and then half of it is honest.
        """
        track = pose_track(window, window.facts.declared.cameras["depth"])
        fields = [field for errors in state if errors.window == window.span.index for field in errors.fields]
        weighed: list[ConventionTrial] = []
        for stream in window.facts.flow_streams:
            off = [field for field in fields if field.interval.stream == stream and field.suspicion > 1]
            if off:
                chosen = sorted(off, key=lambda field: field.suspicion)[(len(off) - 1) // 2]
                weighed += weigh_hypotheses(window, track, chosen.interval, chosen.frame, chosen.region)
        state.append(WindowErrors(window.span.index, weighed=tuple(weighed)))

    def conclude(self, state: Sequence[WindowErrors], facts: Facts) -> Observation:
        """State the endpoint error of each rate, and how large the corrections were."""
        fields = sorted(
            (f for errors in state for f in errors.fields), key=lambda f: (f.interval.stream, f.interval.row)
        )
        weighed = [one for errors in state for one in errors.weighed]
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        if not fields:
            return Observation(coverage, unobservable=_why_none(state))
        noise = facts.declared.pose
        by_stream = {s: [f for f in fields if f.interval.stream == s] for s in facts.flow_streams}
        by_stream = {stream: group for stream, group in by_stream.items() if group}
        off = _off(by_stream)
        unmoved = {stream: _squares_ratio(group) < _UNMOVED for stream, group in by_stream.items()}
        measurements: list[Statistic] = []
        for stream, group in by_stream.items():
            suspects = geometry_suspects(stream, group, weighed, off, facts.declared)
            measurements += [_typical(stream, group, facts, suspects), _worst(stream, group, facts, suspects)]
            if noise and is_noisy(noise):
                measurements += _correction(stream, group, facts, suspects, unmoved)
        notices = () if noise else (_noise_not_declared(),)
        return Observation(coverage, tuple(measurements), notices)


def _typical(stream: str, fields: Sequence[FieldError], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    pixels = sum(field.pixels for field in fields)
    rms_px = float(np.sqrt(sum(field.squares for field in fields) / pixels))
    bound_px = float(np.sqrt(sum(field.bound_squares for field in fields) / pixels))
    off = [field for field in fields if field.suspicion > 1]
    return Statistic(
        name=f"{stream} endpoint_error",
        value=rms_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=bound_px,
        side="upper",
        material=_MATTERS_PX,
        statement=f"{stream} differs from the flow of depth and pose by {rms_px:.3g} px rms, and rounding explains "
        f"{bound_px:.1g} px; {len(off)} of {len(fields)} fields are off.",
        code="flow_geometry.endpoint.error",
        where=_where(off or fields, facts),
        suspects=suspects,
    )


def _worst(stream: str, fields: Sequence[FieldError], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    worst = max(fields, key=lambda field: field.worst_px / field.worst_bound_px)
    column, row = worst.worst_pixel
    return Statistic(
        name=f"{stream} worst_endpoint_error",
        value=worst.worst_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=worst.worst_bound_px,
        side="upper",
        material=_MATTERS_PX,
        statement=f"Field {worst.interval.row} of {stream} differs from the flow of depth and pose by "
        f"{worst.worst_px:.3g} px at column {column}, row {row}; rounding explains {worst.worst_bound_px:.1g} px.",
        code="flow_geometry.endpoint.worst_pixel",
        where=place(facts, (worst.interval, worst.interval), frame=worst.frame, pixel=worst.worst_pixel),
        suspects=suspects,
    )


def _correction(
    stream: str,
    fields: Sequence[FieldError],
    facts: Facts,
    suspects: tuple[Suspect, ...],
    unmoved: Mapping[str, bool],
) -> list[Statistic]:
    """Hold the corrections of every second field (no pose in common) to the declared noise.

    With Q chi-square of n degrees of freedom, (Q/n)^(1/3) is normal about 1 - 2/(9n) with variance 2/(9n) (Wilson and
    Hilferty, PNAS 17 (1931) 684; at n = 6 its five-sigma tails are right within a factor of three).
    """
    tested = _independent(fields)
    if not tested:
        return []
    spread = 2 / (9 * sum(field.twist_dof for field in tested))
    ratio = float(np.cbrt(_squares_ratio(fields)))
    if ratio < 1 - spread:
        from_noisy = 0.95 if unmoved[stream] else 0.3
        suspects = (
            Suspect("flow_from_noisy_pose", spreads_over(stream, unmoved), from_noisy),
            Suspect("noise_misdeclared", "pose", 0.9 - from_noisy / 2, 100 * (1 / ratio**1.5 - 1) if ratio else None),
        )
    elif not suspects or suspects[0].cause in ("unknown", "noise_misdeclared"):
        suspects = (
            Suspect("noise_misdeclared", "pose", 0.9, 100 * (1 / ratio**1.5 - 1), "percent"),
            Suspect(ANY_CAUSE, "pose", 0.8),
            *suspects,
        )
    return [
        Statistic(
            name=f"{stream} pose_correction",
            value=ratio,
            unit="1",
            standard_error=float(np.sqrt(spread)),
            expected=1 - spread,
            statement=f"The corrections of the pose that {stream} asks for are {ratio**1.5:.3g} times as large as the "
            "declared pose noise makes them.",
            code="flow_geometry.endpoint.pose_correction",
            where=_where(tested, facts),
            suspects=suspects,
        )
    ]


def _independent(fields: Sequence[FieldError]) -> list[FieldError]:
    """Return every second field of those that were held to the noise: their intervals share no pose."""
    return [field for field in fields if field.twist_dof > 0 and field.interval.row % 2 == 0]


def _squares_ratio(fields: Sequence[FieldError]) -> float:
    """Return the squared corrections over their expectation; 1 where none was tested."""
    tested = _independent(fields)
    dof = sum(field.twist_dof for field in tested)
    return sum(field.twist_chi2 for field in tested) / dof if dof > 0 else 1.0


def _where(fields: Sequence[FieldError], facts: Facts) -> Where:
    worst = max(fields, key=lambda field: field.suspicion)
    return place(facts, (fields[0].interval, fields[-1].interval), frame=worst.frame, pixel=worst.worst_pixel)


def _off(by_stream: Mapping[str, Sequence[FieldError]]) -> Mapping[str, bool]:
    """Say which rates are off, or would not show it: what is wrong with all rates grows with their intervals."""
    suspicions = {stream: _suspicion(fields) for stream, fields in by_stream.items()}
    lengths_s = {stream: fields[0].interval.duration_s for stream, fields in by_stream.items()}
    growth = max(
        (suspicion / max(lengths_s[stream], 1e-9) for stream, suspicion in suspicions.items() if suspicion > 1),
        default=0.0,
    )
    return {stream: suspicions[stream] > 1 or 0 < growth * lengths_s[stream] <= _SHOWN for stream in by_stream}


def _suspicion(fields: Sequence[FieldError]) -> float:
    return max((field.suspicion for field in fields), default=0.0)


def _why_none(state: Sequence[WindowErrors]) -> str:
    reasons: Mapping[str, int] = {
        "start or end on no frame": sum(errors.without_depth for errors in state),
        "are not covered by poses": sum(errors.without_pose for errors in state),
        "share too few valid pixels with the depth": sum(errors.too_few_pixels for errors in state),
    }
    found = [f"{count} {reason}" for reason, count in reasons.items() if count]
    return "of the fields of flow " + ", ".join(found) if found else "there is no field of flow"


def _noise_not_declared() -> Notice:
    return Notice(
        "flow_geometry.endpoint.undeclared",
        "The pose's noise is not declared, so that each field was allowed any correction of its relative pose: "
        "faults of time and mounting cannot be seen.",
    )
