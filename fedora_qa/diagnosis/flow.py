"""Hypotheses that all checks of flow share: inverse transforms, and gains that correspond to a cause."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.causes import CAUSES
from fedora_qa.diagnosis.convention_trials import support_of_extent
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.views.flow_conventions import ConventionTrial

CAUSES_OF_TRANSFORM: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({
    "negated": ("flow_sign",),
    "transposed_axes": ("axes_swapped",),
    "flipped_v": ("frame_convention",),
    "north_east_down": ("frame_convention",),
    "other_mounting": ("frame_convention",),
    "another_unit": ("flow_unit",),
    "scaled": ("flow_gain",),
    "shifted_pixels": ("spatial_offset",),
    "rescaled_by_interval": ("flow_unit",),
    "times_interval": ("flow_unit",),
    "divided_by_interval": ("flow_unit",),
    "mirrored_columns": ("mirrored",),
    "mirrored_rows": ("mirrored",),
    "neighbouring_interval": ("flow_interval_shifted", "swapped_frames"),
    "shifted_interval": ("flow_interval_shifted",),
    "neighbouring_frame": ("swapped_frames",),
    "delayed": ("time_offset",),
    "field_of_another_rate": ("flow_rate_mixed",),
    "exchanged_frames": ("swapped_frames",),
    "repeated_field": ("frozen_frames",),
    "repeated_frame": ("frozen_frames",),
    "ray_lengths": ("depth_ray_not_z",),
    "metric_unit": ("unit_mm_m",),
    "triangulated_depth": ("other_sequence",),
    "conjugated_quaternion": ("quaternion_inverted",),
    "reordered_quaternion": ("quaternion_order",),
})  # fmt: skip
"""Causes that a transform of flow, frames, depth or poses would undo, for all checks of flow.

A transform without a row has the name of its cause ("mirrored").
"""

CAUSES_OF_TWO_TRANSFORMS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "negated_in_another_unit": ("flow_unit", "flow_sign"),
        "transposed_axes_in_another_unit": ("flow_unit", "axes_swapped"),
        "flipped_v_in_another_unit": ("flow_unit", "frame_convention"),
    }
)
"""Causes that are there together where one transform after the other removes the deviation; the first has the size."""

_SUPPORT_OF_TRANSFORM: Final = MappingProxyType({"triangulated_depth": support("flow.triangulated_depth")})
"""Factor on the removed share; 1 for transforms without a row."""

_UNSIGNED: Final = ("swapped_frames",)
"""Causes whose size is a distance without a sign."""

_OF_DISPLACED_FLOW: Final = (
    "flow_interval_shifted", "flow_rate_mixed", "mirrored", "spatial_offset", "frozen_frames", "swapped_frames",
    "time_offset", "other_sequence",
)  # fmt: skip
_OF_DISPLACED_DEPTH: Final = (
    "mirrored", "spatial_offset", "frozen_frames", "swapped_frames", "time_offset", "other_sequence",
)  # fmt: skip
DISPLACEMENTS: Final = (
    *((cause, "flow", support("flow.displacement")) for cause in _OF_DISPLACED_FLOW),
    *((cause, "depth", support("flow.displacement")) for cause in _OF_DISPLACED_DEPTH),
)
"""Causes that displace flow against depth: cause, stream, and a small support that adds to stronger evidence."""


def spreads_over(stream: str, off: Mapping[str, bool]) -> str:
    """Return ``flow`` where every rate deviates, otherwise the one rate: an equal deviation of all rates is one fault.

    Parameters
    ----------
    stream
        ``flow/<rate>hz``, the rate of the alarm.
    off
        Whether each rate deviates, by stream.
    """
    return "flow" if all(off.values()) else stream


def convention_hypotheses(
    rate: str, trials: Sequence[ConventionTrial], flow: str, *, share_off: float
) -> list[Hypothesis]:
    """Return the mean removed share of each inverse transform, over the fields of one rate on which it was tried.

    Parameters
    ----------
    rate
        Only trials of this rate count.
    trials
        Of any rates.
    flow
        Stream that is named for trials of the flow: ``flow`` or one rate.
    share_off
        Share of fields that deviate, 0 to 1. Faults of single frames affect few fields, other faults most.

    Returns
    -------
    list[Hypothesis]
        One for each cause and stream, in the order of the trials.
    """
    by_cause: dict[tuple[str, str, str], list[ConventionTrial]] = {}
    for trial in trials:
        if trial.rate == rate:
            together = CAUSES_OF_TWO_TRANSFORMS.get(trial.transform)
            for cause in together or CAUSES_OF_TRANSFORM.get(trial.transform, (trial.transform,)):
                by_cause.setdefault((cause, trial.stream, trial.transform if together else ""), []).append(trial)
    hypotheses: dict[tuple[str, str], Hypothesis] = {}
    for (cause, stream, _), group in by_cause.items():
        supports = [_SUPPORT_OF_TRANSFORM.get(trial.transform, 1.0) * trial.removed_share for trial in group]
        mean_support = float(np.mean(supports))
        mean_support *= support_of_extent(cause, share_off)
        # The size comes from the field that the transform explains best: in other fields another fault may contribute.
        magnitude = max(zip(supports, group, strict=True), key=lambda pair: pair[0])[1].magnitude
        if magnitude is not None and cause in _UNSIGNED:
            magnitude = abs(magnitude)
        # A transform without a row raises ``KeyError`` here, unless it is named as a cause.
        unit = CAUSES[cause].unit
        size = magnitude if unit else None
        blamed = flow if stream == "flow" else stream
        hypothesis = Hypothesis(cause, blamed, mean_support, size, "" if size is None else unit)
        # Alone, or beside a second cause: by the transform that removes most.
        if (cause, stream) not in hypotheses or mean_support > hypotheses[cause, stream].support:
            hypotheses[cause, stream] = hypothesis
    return list(hypotheses.values())


def gain_hypothesis(
    flow: str, gain: float, error: float | None, removed_share: float, seconds: float, tolerance: float
) -> Hypothesis:
    """Return the cause of a gain of the flow: another sign, another unit of time, or a gain.

    A gain of -2 is the opposite sign. A factor equal to the length of the interval, or to its reciprocal, is another
    unit. The opposite sign beside a unit, and a gain beside the opposite sign, show once the first is undone.

    Parameters
    ----------
    flow
        Stream that is named.
    gain
        Excess of the factor over 1 (0.1 for vectors that are 10% too long).
    error
        Standard error of ``gain``; None where it is not known.
    removed_share
        Share of the deviation that the gain explains, 0 to 1. It becomes the support.
    seconds
        Length of the interval, s.
    tolerance
        Largest relative difference from a unit that counts as such.

    Returns
    -------
    Hypothesis
        ``flow_sign``, ``flow_unit``, or ``flow_gain`` with its size in percent.
    """
    factor = 1 + gain
    # A field in px/s is that in px times 1 / seconds; one in px s is that in px times seconds.
    for unit_factor in (seconds, 1 / seconds) if seconds > 0 else ():
        if abs(abs(factor) / unit_factor - 1) < tolerance:
            return Hypothesis("flow_unit", flow, removed_share, unit_factor, "1")
    # The opposite sign, and maybe a gain besides: between -3 and -1 / 3 the sign leaves |1 - |factor||, which is less
    # than half of 1 + |factor|.
    if -3 < factor < -1 / 3:
        return Hypothesis("flow_sign", flow, removed_share)
    return Hypothesis("flow_gain", flow, removed_share, 100 * gain, "percent", None if error is None else 100 * error)
