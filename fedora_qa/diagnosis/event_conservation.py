"""Hypotheses for pixels whose events contradict the frames."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp
from types import MappingProxyType
from typing import Final

from fedora_qa.checks.event_response.conservation import ViolationCluster, Violations
from fedora_qa.diagnosis.event_response import whose_offset
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.conservation_trials import InverseTrial, Resolution, Transform

_FEW: Final = 0.05
"""Fraction of the pixels that some lost or doubled events spoil at most."""

_ONE_REGION: Final = 0.6
"""Fraction of the violating pixels that lie together, and of those without an event, from which on a region is dead."""

_RESOLVED: Final = 0.8
"""Fraction of the violations that an inverse transform must resolve, net. In 36 damaged files right transforms of a
whole window or its half reached 0.8 to 1; wrong ones, where none was right, 0.6 of twenty pixels or more and 0.5 of
fifty."""

_ENOUGH_VIOLATIONS: Final = 50
"""Violations of a part from which on it is informative that no inverse transform resolves them."""

_DOMINANT: Final = 3.0
"""Times the violations that the next best transform resolves, over all windows, for the best to be the right one."""

_PARTS: Final = 3
"""A window and its halves."""

_CAUSES: Final[Mapping[Transform, str]] = MappingProxyType(
    {
        "invert_polarity": "polarity_inverted",
        "mirror": "mirrored",
        "swap_axes": "axes_swapped",
        "shift": "spatial_offset",
        "delay": "time_offset",
    }
)
"""The fault that each inverse transform undoes."""

_OF_FRAMES_TOO: Final = frozenset({"mirrored", "spatial_offset", "time_offset"})
"""Faults of frames that have the effect of the same fault of events, of opposite sign."""

_BREAKS_THE_LAW: Final = (
    *((cause, "events")
      for cause in ("time_offset", "clock_rate", "polarity_inverted", "mirrored", "axes_swapped", "other_sequence",
                    "threshold_misdeclared", "event_model_misdeclared", "spatial_offset", "hot_pixels", "time_unit")),
    *((cause, "rgb")
      for cause in ("swapped_frames", "frozen_frames", "exposure_or_gamma", "channel_order", "time_offset",
                    "clock_rate", "mirrored", "other_sequence", "spatial_offset")),
)  # fmt: skip
"""Every fault of events or frames breaks the law of conservation."""


def propose_conservation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.conservation``.

    Where an inverse transform resolves the violations, other causes are left to what that does not explain. Where the
    law is broken all over and no transform resolves it, events and frames may not belong together.
    """
    features = alarm.statistic.features
    (violations,) = (feature for feature in features if isinstance(feature, Violations))
    (cluster,) = (feature for feature in features if isinstance(feature, ViolationCluster))
    trials = [feature for feature in features if isinstance(feature, InverseTrial)]
    few = violations.fraction < _FEW
    # Violations of one dead region lie together, and without events; or, of a region that is dead for some time, so
    # close together that no loss of single events could be: a lost packet spoils few pixels of any neighbourhood.
    no_events = facts.events is None or not facts.events.count
    if not no_events and min(cluster.fraction_nearby, cluster.fraction_without_events) > _ONE_REGION:
        dead = _support("dead_region")
    elif not no_events and cluster.fraction_of_image < _FEW and cluster.fraction_in_densest_square > _ONE_REGION:
        dead = _support("dead_region_for_some_time")
    else:
        dead = _support("dead_region_unlikely")
    if alarm.finding.code == "event_response.conservation.region":
        count, dead_region = None, Hypothesis("dead_region", "events", dead, cluster.side_px, "px")
    else:
        of_pixels = _support("dead_region_of_pixels")
        count, dead_region = float(violations.pixels), Hypothesis("dead_region", "events", of_pixels * dead)
    by_trial = hypotheses_of_trials(trials, facts)
    remaining = _support("beside_a_trial") if by_trial else 1.0
    unrelated: tuple[Hypothesis, ...] = ()
    if not few and unresolved(trials):
        unrelated = tuple(
            Hypothesis("other_sequence", stream, _support("other_sequence")) for stream in ("events", "rgb")
        )
    # Lost or doubled events spoil few pixels; what moves events or frames spoils most of those that fire. Doubled ones
    # mostly share their timestamps as well, which ``event_stream.duplicates`` detects; lost ones leave no other trace.
    if no_events:
        samples: tuple[Hypothesis, ...] = (Hypothesis("dropped_samples", "events", _support("no_events")),)
    else:
        lost, doubled = ("lost_of_few", "doubled_of_few") if few else ("lost_of_many", "doubled_of_many")
        samples = (
            Hypothesis("dropped_samples", "events", _support(lost), count, "samples"),
            Hypothesis("duplicated_samples", "events", _support(doubled), count, "samples"),
        )
    any_fault = tuple(Hypothesis(cause, stream, _support("any_fault")) for cause, stream in _BREAKS_THE_LAW)
    beside = (dead_region, *unrelated, *samples, *any_fault)
    # Events that end more than two frames before the frames do were cut off.
    cut_off: tuple[Hypothesis, ...] = ()
    times_ns = facts.clocks["rgb"].times_ns
    if facts.events is not None and facts.events.count and len(times_ns) >= 2:
        duration_ns, silent_ns = int(times_ns[-1] - times_ns[0]), int(times_ns[-1]) - facts.events.last_ns
        # silent > 2 duration / (n - 1), multiplied out: whole nanoseconds without a division.
        if silent_ns * (len(times_ns) - 1) > 2 * duration_ns:
            cut_off = (Hypothesis("truncated", "events", _support("truncated")),)
    return (*by_trial, *cut_off, *(replace(each, support=remaining * each.support) for each in beside))


def hypotheses_of_trials(trials: Sequence[InverseTrial], facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes whose inverse resolves a part, of the part where most is; none where none resolves enough.

    A transform that leaves more violations than the best one is less probable by exp(-1) for each twentieth of them.
    Frames that were moved or mirrored have the effect of events that were. Where no part of many violations is
    resolved, a few pixels at the end of a file that some transform resolves are chance.
    """
    if unresolved(trials):
        return ()
    resolved = [trial for trial in trials if trial.best >= _RESOLVED * trial.violations]
    if not resolved:
        return _dominant_hypotheses(trials, facts)
    trial = max(resolved, key=lambda candidate: candidate.best)
    # One twentieth of the violations (docstring), and one pixel at least: few violations decide nothing by a fraction.
    scale = max(1.0, 0.05 * trial.violations)
    weights = {
        resolution: _support("resolved") * exp((resolution.pixels - trial.best) / scale)
        for resolution in trial.resolutions
    }
    # An offset of time larger than those tried shifts what moves evenly.
    larger_offset = _support("larger_time_offset") * max(
        weight for resolution, weight in weights.items() if resolution.transform == "shift"
    )
    return (
        *(hypothesis for resolution, weight in weights.items() for hypothesis in _of(resolution, weight, facts)),
        *_of(Resolution("delay", 0), larger_offset, facts),
    )


def _dominant_hypotheses(trials: Sequence[InverseTrial], facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the cause whose inverse resolves most over all windows, by far; none where there is no such.

    In noise, no transform resolves the violations of spurious events, so that the right one falls short of
    ``_RESOLVED``. A wrong one that resolves by chance is followed closely by another wrong one, or by one of its kind
    in another window.
    """
    whole: dict[int, InverseTrial] = {}
    for trial in trials:
        # Of a window and its halves the whole one has the most violations.
        if trial.window not in whole or trial.violations > whole[trial.window].violations:
            whole[trial.window] = trial
    violations = sum(trial.violations for trial in whole.values())
    resolved: Counter[str] = Counter()
    for trial in whole.values():
        # Net counts can be negative: what a transform breaks in one window must not cancel what it resolves in another.
        resolved.update({resolution.transform: max(resolution.pixels, 0) for resolution in trial.resolutions})
    # Padded with empty pairs, as fewer than two transforms may have been tried.
    (transform, most), (_, next_best), *_ = (*resolved.most_common(2), ("", 0), ("", 0))
    if violations < _ENOUGH_VIOLATIONS or most < violations / 2 or most < _DOMINANT * next_best:
        return ()
    candidates = (each for trial in whole.values() for each in trial.resolutions if each.transform == transform)
    best = max(candidates, key=lambda resolution: resolution.pixels)
    return _of(best, _support("resolved") * most / violations, facts)


def unresolved(trials: Sequence[InverseTrial]) -> bool:
    """Whether a window with many violations has some in both halves, and no transform resolves half of any such part.

    A loss at one instant breaks one half only.
    """
    informative = [trial for trial in trials if trial.violations >= _ENOUGH_VIOLATIONS]
    parts = Counter(trial.window for trial in trials)
    throughout = any(parts[trial.window] == _PARTS for trial in informative)
    return throughout and all(trial.best < trial.violations / 2 for trial in informative)


def _of(resolution: Resolution, weight: float, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the fault that a transform undoes, of the events and where it may be theirs of the frames."""
    cause, size = _CAUSES[resolution.transform], resolution.size
    of_events, of_frames = _support("events"), _support("frames")
    if cause == "time_offset":
        of_events, of_frames = whose_offset(size or 0.0, facts)
    # The likelier of the two streams has the whole weight of the trial, the other its share.
    events = Hypothesis(cause, "events", weight * of_events / max(of_events, of_frames), size)
    if cause not in _OF_FRAMES_TOO:
        return (events,)
    opposite = None if size is None else -size
    return events, Hypothesis(cause, "rgb", weight * of_frames / max(of_events, of_frames), opposite)


def _support(row: str) -> float:
    return support(f"event_response.conservation.{row}")
