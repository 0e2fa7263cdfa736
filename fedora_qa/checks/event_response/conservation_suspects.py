"""Which causes make events and frames contradict each other (``conservation``)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_response.inverse_trials import Trial, causes_by_undoing, nothing_mends
from fedora_qa.checks.protocol import Suspect
from fedora_qa.sequence.facts import Facts

Bool = NDArray[np.bool_]

FEW: Final = 0.05
"""Share of the pixels that some lost or doubled events spoil at most (in the diagnosis, after an alarm)."""

_WHATEVER_BREAKS_THE_LAW: Final = (
    *(
        Suspect(cause, "events", 0.3)
        for cause in ("time_offset", "clock_rate", "polarity_inverted", "mirrored", "axes_swapped", "other_sequence",
                      "threshold_misdeclared", "event_model_misdeclared", "spatial_offset", "hot_pixels", "time_unit")
    ),
    *(
        Suspect(cause, "rgb", 0.3)
        for cause in ("swapped_frames", "frozen_frames", "exposure_or_gamma", "channel_order", "time_offset",
                      "clock_rate", "mirrored", "other_sequence", "spatial_offset")
    ),
)  # fmt: skip
"""Every fault of events or frames breaks it; which one, other checks say better."""


_UNRELATED: Final = (Suspect("other_sequence", "events", 0.5), Suspect("other_sequence", "rgb", 0.5))

_LEFT: Final = 0.3
"""What a repair that mends most of a part leaves to the causes that were not tried."""


def why_broken(
    pixels: Bool, count: float | None, dead: Suspect, tried: Sequence[Trial], facts: Facts
) -> tuple[Suspect, ...]:
    """Return what would break the law in so many ``pixels`` (h, w).

    ``dead`` is a region without events. Where undoing a fault mends the pixels, other causes are left to what that does
    not explain; where the law is broken all over and nothing mends it, events and frames may not belong together.
    """
    undone = causes_by_undoing(tried, facts)
    left = _LEFT if undone else 1.0
    unrelated = float(pixels.mean()) >= FEW and nothing_mends(tried)
    others = (
        dead,
        *(_UNRELATED if unrelated else ()),
        *_lost_or_doubled(pixels, count, facts),
        *_WHATEVER_BREAKS_THE_LAW,
    )
    return (*undone, *_cut_off(facts), *(replace(one, weight=left * one.weight) for one in others))


def _lost_or_doubled(pixels: Bool, count: float | None, facts: Facts) -> tuple[Suspect, ...]:
    """Weigh lost and doubled events: they spoil few pixels, what moves events or frames spoils most that fire.

    Doubled events mostly share their stamps as well, which ``event_stream.duplicates`` sees; lost ones leave no trace.
    """
    if facts.events is None or not facts.events.count:
        return (Suspect("dropped_samples", "events", 0.9),)
    few = float(pixels.mean()) < FEW
    return (
        Suspect("dropped_samples", "events", 0.5 if few else 0.2, count, "samples"),
        Suspect("duplicated_samples", "events", 0.4 if few else 0.15, count, "samples"),
    )


def _cut_off(facts: Facts) -> tuple[Suspect, ...]:
    """Suspect that events were cut off, where they end more than two frames before the frames do."""
    times_ns = facts.clocks["rgb"].times_ns
    if facts.events is None or not facts.events.count or len(times_ns) < 2:
        return ()
    duration_ns, silent_ns = int(times_ns[-1] - times_ns[0]), int(times_ns[-1]) - facts.events.last_ns
    if silent_ns * (len(times_ns) - 1) <= 2 * duration_ns:
        return ()
    return (Suspect("truncated", "events", 0.8),)
