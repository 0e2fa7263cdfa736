"""Hypotheses for pixels whose events contradict the frames: alarms of ``event_response.conservation``."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, expm1, sqrt
from types import MappingProxyType
from typing import Final

from fedora_qa.checks.event_response.conservation import (
    TILE_PX,
    ChangeCourses,
    LoneEventRate,
    ViolationCluster,
    Violations,
)
from fedora_qa.conventions import NS_PER_S
from fedora_qa.diagnosis.event_balance import has_spurious_events, hypotheses_of_balance
from fedora_qa.diagnosis.event_response import hypotheses_of_brief_events, whose_offset
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.diagnosis.measured_sizes import rgb_px_per_event_px
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.conservation_trials import InverseTrial, Resolution, Transform

_FEW: Final = 0.05
"""Largest fraction of violating pixels by single lost or doubled events."""

_ONE_REGION: Final = 0.6
"""Least fraction of the violating pixels that lie together, and of those without an event, for a dead region."""

_ALL_SILENT: Final = 0.95
"""Least fraction of the violating pixels that never fire for dead pixels of any shape: of events that are lost, pixels
keep some. The rest is left for flaws of antialiasing beside them. Not derived: of 20 kinds of losses, noise and wrong
frames in two scenes, the largest fraction was 0.81, of events that were all moved to even pixels."""

_NEARLY_ALL: Final = 0.9
"""Least fraction of the violating pixels in one neighbourhood for a region that is dead for some time: the rest is left
for flaws of antialiasing."""

_SMALL: Final = 0.25
"""Largest fraction of the image, or of the changes by events, for such a neighbourhood: eight violations (the fewest
that are judged) that lie independently all fall into one given neighbourhood by chance in 0.25^8 = 0.002% of cases."""

_RESOLVED: Final = 0.8
"""Fraction of the violations that an inverse transform must resolve, net. In 36 damaged files, correct transforms of a
window or its half resolved 0.8 to 1. Wrong transforms, where none was correct, resolved up to 0.6 of 20 or more pixels,
and up to 0.5 of 50."""

_ENOUGH_VIOLATIONS: Final = 50
"""Least number of violations of a part for a conclusion from the fact that no inverse transform resolves them."""

_DOMINANT: Final = 3.0
"""Least ratio of the violations that the best transform resolves, over all windows, to those of the next best one."""

_PARTS: Final = 3
"""Number of parts: a window and its halves."""

_UNIFORM: Final = 0.5
"""Least ratio of the rate of lone events that three quarters of the image reach to the mean rate, for noise: of edges
alone it is near 0, as most tiles have none at a time."""

_FEWEST_DISTURBED: Final = 0.1
"""Least share of the pixels with a spurious event that violate the law, for noise: a pixel shows one whose level moves
enough; background activity in the park disturbs half. Not derived: with fewer, the lone events are those of faint
edges everywhere. Declared noise, whose rates are upper bounds, may as well be all that fires and violates the law."""

_MOSTLY_SILENT: Final = 0.5
"""Least share of the violating pixels in tiles that are silent for a while, for a dead region: a readout that saturates
silences a tile as well, and loses events elsewhere."""

_SIGMAS_OF_A_TILE: Final = 5.0
"""Standard deviations by which the worst of some thousand tiles may exceed the mean share of noise: one in a million
does."""

_MEASURED: Final = support("event_response.conservation.dead_region_for_some_time")
"""Least support of a dead region whose pixels say more than the number of the events in all."""

_LEAST_COMMON_PERCENT: Final = 2.0
"""Least common gain of the frames for another exposure: tiles of correct frames differ by as much. Not derived."""

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
      for cause in ("time_offset", "clock_rate", "time_jitter", "polarity_inverted", "mirrored", "axes_swapped",
                    "other_sequence", "threshold_misdeclared", "event_model_misdeclared", "spatial_offset",
                    "hot_pixels", "time_unit")),
    *((cause, "rgb")
      for cause in ("swapped_frames", "frozen_frames", "exposure_or_gamma", "channel_order", "time_offset",
                    "clock_rate", "mirrored", "other_sequence", "spatial_offset")),
    # Of a camera that is turned the pixels see something else.
    ("extrinsic_rotation", "metadata"),
)  # fmt: skip
"""Every fault of events or frames violates the law of conservation."""


def propose_conservation(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm of ``event_response.conservation``.

    Where an inverse transform resolves the violations, other causes have reduced support. Where the law is violated in
    many pixels and no transform resolves this, events and frames may be of different sequences.
    """
    features = alarm.statistic.features
    (violations,) = (feature for feature in features if isinstance(feature, Violations))
    (cluster,) = (feature for feature in features if isinstance(feature, ViolationCluster))
    trials = [feature for feature in features if isinstance(feature, InverseTrial)]
    courses = next((feature for feature in features if isinstance(feature, ChangeCourses)), ChangeCourses())
    rates = [feature for feature in features if isinstance(feature, LoneEventRate)]
    noise = _of_noise(rates, violations, cluster.fraction_of_worst_tile, facts)
    few = violations.fraction < _FEW
    # Violations of a dead region lie together, in pixels without events; rows or columns that are dead form a band.
    # Violations of a region that is dead for some time lie closer together than those of lost events: a lost packet
    # affects few pixels of any neighbourhood.
    no_events = facts.events is None or not facts.events.count
    together = max(cluster.fraction_nearby, cluster.fraction_in_densest_band)
    # Declared noise disturbs pixels that fire, besides.
    is_noise_beside = cluster.fraction_without_events > _ONE_REGION and cluster.firing_of_disturbed < _FEWEST_DISTURBED
    if not no_events and (cluster.fraction_without_events > _ALL_SILENT or is_noise_beside):
        dead = _support("dead_pixels")
    elif not no_events and min(together, cluster.fraction_without_events) > _ONE_REGION:
        dead = _support("dead_region")
    elif courses.silent_share > _MOSTLY_SILENT and not no_events:
        dead = _support("silent_tiles")
    elif (
        not no_events
        # What lies together may be in excess as well, which events against the light state.
        and not has_spurious_events(features, facts.declared.events)
        and cluster.fraction_of_image < _FEW
        and (cluster.fraction_in_densest_square > _ONE_REGION or _lies_in_one_place(cluster))
    ):
        dead = _support("dead_region_for_some_time")
    else:
        dead = _support("dead_region_unlikely")
    if alarm.finding.code == "event_response.conservation.region":
        count, dead_region = None, Hypothesis("dead_region", "events", dead, cluster.side_px, "px")
    else:
        of_pixels = _support("dead_region_of_pixels")
        count, dead_region = float(violations.pixels), Hypothesis("dead_region", "events", of_pixels * dead)
    by_trial = hypotheses_of_trials(trials, facts)
    # A transform that resolves the violations states more than the number of the events.
    is_measured = bool(by_trial or noise) or dead >= _MEASURED
    by_balance = () if is_measured else hypotheses_of_balance(features, facts.declared.events)
    remaining = _support("beside_a_trial") if by_trial else _support("beside_a_balance") if by_balance else 1.0
    of_whole_stream = hypotheses_of_brief_events(facts)
    if not of_whole_stream and not few and unresolved(trials):
        of_whole_stream = tuple(
            Hypothesis("other_sequence", stream, _support("other_sequence")) for stream in ("events", "rgb")
        )
    # Lost or doubled events affect few pixels; a move of events or frames affects most pixels with events. Doubled
    # events mostly have equal timestamps as well, which ``event_stream.duplicates`` detects; lost events are not
    # detected otherwise.
    if no_events:
        samples: tuple[Hypothesis, ...] = (Hypothesis("missing_stream", "events", _support("no_events")),)
    else:
        lost, doubled = ("lost_of_few", "doubled_of_few") if few else ("lost_of_many", "doubled_of_many")
        samples = (
            Hypothesis("dropped_samples", "events", _support(lost), count, "samples"),
            Hypothesis("duplicated_samples", "events", _support(doubled), count, "samples"),
        )
    any_fault = tuple(Hypothesis(cause, stream, _support("any_fault")) for cause, stream in _BREAKS_THE_LAW)
    beside = (*_of_courses(courses), dead_region, *of_whole_stream, *samples, *any_fault)
    # Events that end more than two frames before the frames do were cut off.
    cut_off: tuple[Hypothesis, ...] = ()
    times_ns = facts.clocks["rgb"].times_ns
    if facts.events is not None and facts.events.count and len(times_ns) >= 2:
        duration_ns, silent_ns = int(times_ns[-1] - times_ns[0]), int(times_ns[-1]) - facts.events.last_ns
        # silent > 2 duration / (n - 1), multiplied out: whole nanoseconds without a division.
        if silent_ns * (len(times_ns) - 1) > 2 * duration_ns:
            cut_off = (Hypothesis("truncated", "events", _support("truncated")),)
    others = (replace(each, support=remaining * each.support) for each in beside)
    return (*by_trial, *by_balance, *cut_off, *noise, *others)


def _of_courses(courses: ChangeCourses) -> tuple[Hypothesis, ...]:
    """Return another exposure, and another sequence for a while, where frames and events change so over time."""
    hypotheses: list[Hypothesis] = []
    if abs(courses.common_percent) > _LEAST_COMMON_PERCENT:
        supported = _support("common_change")
        hypotheses.append(Hypothesis("exposure_or_gamma", "rgb", supported, courses.common_percent, "percent"))
    if courses.unrelated_percent:
        hypotheses += [
            Hypothesis("other_sequence", stream, _support(f"unrelated_{name}"), courses.unrelated_percent, "percent")
            for stream, name in (("events", "events"), ("rgb", "frames"))
        ]
    return tuple(hypotheses)


def _of_noise(
    rates: Sequence[LoneEventRate], violations: Violations, of_worst_tile: float, facts: Facts
) -> tuple[Hypothesis, ...]:
    """Return noise that is not declared, where lone events are as many everywhere and enough for the violations.

    A spurious event moves its pixel by a threshold, which any pixel that uses its range shows: of noise with r events a
    second, a share of at most 1 - exp(-r s) of the pixels violates the law within s seconds, and not many fewer. Each
    pixel does so by itself: a tile of which more do has lost events, or others than those of noise.
    """
    declared = facts.declared.events
    if declared is None:
        return ()
    declared_hz = declared.shot_rate_hz + declared.leak_rate_hz
    for rate in rates:
        excess_hz = rate.quiet_hz - declared_hz
        is_uniform = rate.quiet_hz > _UNIFORM * rate.mean_hz
        with_noise = -expm1(-excess_hz * rate.seconds)
        explains = _FEWEST_DISTURBED * with_noise < violations.fraction < with_noise
        if excess_hz > 0 and is_uniform and explains and of_worst_tile < _largest_share_of_a_tile(rate, facts):
            percent = 100 * excess_hz / declared_hz if declared_hz > 0 else None
            unit = "" if percent is None else "percent"
            return (Hypothesis("noise_misdeclared", "events", _support("uniform_lone_events"), percent, unit),)
    return ()


def _largest_share_of_a_tile(rate: LoneEventRate, facts: Facts) -> float:
    """Return the largest share of the pixels of a tile that noise of the mean rate disturbs in the whole file."""
    times_ns = facts.clocks["rgb"].times_ns
    seconds = max(float(times_ns[-1] - times_ns[0]) / NS_PER_S, rate.seconds) if len(times_ns) else rate.seconds
    share = -expm1(-rate.mean_hz * seconds)
    return share + _SIGMAS_OF_A_TILE * sqrt(share * (1 - share)) / TILE_PX


def _lies_in_one_place(cluster: ViolationCluster) -> bool:
    """Whether a small neighbourhood holds nearly all violations, of which the region itself has as few as it has edges.

    Outside of a dead region nothing is lost; lost events lie wherever the image has edges: in a box as often as the
    events that follow these.
    """
    if not cluster.fraction_in_densest_square:
        return False
    if cluster.changes_in_box < _SMALL:
        return True
    # The neighbourhood of the worst tile, as in the check: its reach is the side of the square and a tile.
    side_px = 2 * (cluster.side_px + TILE_PX) + TILE_PX
    share_of_image = side_px**2 * cluster.fraction_of_image / cluster.side_px**2
    return cluster.fraction_nearby > _NEARLY_ALL and share_of_image < _SMALL


def hypotheses_of_trials(trials: Sequence[InverseTrial], facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes whose inverse resolves the violations of a part; none where no inverse resolves enough.

    The part with the most resolved violations counts. A transform that leaves more violations than the best one is less
    probable by exp(-1) for each twentieth of the violations. A move or a mirror image of the frames has the effect of
    that of the events. Where no part with many violations is resolved, resolved pixels of smaller parts are taken as
    chance.

    Parameters
    ----------
    trials
        Of all tried windows and their halves.
    facts
        With the clocks of frames, depth and flow.

    Returns
    -------
    tuple
        Support by net resolved violations; sizes in px or ms.
    """
    if unresolved(trials):
        return ()
    resolved = [trial for trial in trials if trial.best >= _RESOLVED * trial.violations]
    if not resolved:
        return _dominant_hypotheses(trials, facts)
    trial = max(resolved, key=lambda candidate: candidate.best)
    # One twentieth of the violations (docstring), and one pixel at least: of few violations a fraction is less than a
    # pixel.
    scale = max(1.0, 0.05 * trial.violations)
    weights = {
        resolution: _support("resolved") * exp((resolution.pixels - trial.best) / scale)
        for resolution in trial.resolutions
    }
    # An offset of time beyond the tried delays has the effect of a shift where the image moves evenly.
    larger_offset = _support("larger_time_offset") * max(
        weight for resolution, weight in weights.items() if resolution.transform == "shift"
    )
    return (
        *(hypothesis for resolution, weight in weights.items() for hypothesis in _of(resolution, weight, facts)),
        *_of(Resolution("delay", 0), larger_offset, facts),
    )


def _dominant_hypotheses(trials: Sequence[InverseTrial], facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the cause whose inverse resolves by far the most violations of all windows; none without such a cause.

    No transform resolves the violations of spurious events, so in noise the correct transform resolves less than
    ``_RESOLVED``. A wrong transform that resolves violations by chance is not much better than another wrong transform,
    or than itself in another window.
    """
    whole: dict[int, InverseTrial] = {}
    for trial in trials:
        # Of a window and its halves, the window has the most violations.
        if trial.window not in whole or trial.violations > whole[trial.window].violations:
            whole[trial.window] = trial
    violations = sum(trial.violations for trial in whole.values())
    resolved: Counter[str] = Counter()
    for trial in whole.values():
        # Net counts can be negative: new violations in one window must not cancel resolved ones in another.
        resolved.update({resolution.transform: max(resolution.pixels, 0) for resolution in trial.resolutions})
    # Padded with empty pairs, as fewer than two transforms may have been tried.
    (transform, most), (_, next_best), *_ = (*resolved.most_common(2), ("", 0), ("", 0))
    if violations < _ENOUGH_VIOLATIONS or most < violations / 2 or most < _DOMINANT * next_best:
        return ()
    candidates = (each for trial in whole.values() for each in trial.resolutions if each.transform == transform)
    best = max(candidates, key=lambda resolution: resolution.pixels)
    return _of(best, _support("resolved") * most / violations, facts)


def unresolved(trials: Sequence[InverseTrial]) -> bool:
    """Whether a window has many violations, some in both halves, and no transform resolves half of those of any part.

    A loss at one instant causes violations in one half only.
    """
    informative = [trial for trial in trials if trial.violations >= _ENOUGH_VIOLATIONS]
    parts = Counter(trial.window for trial in trials)
    throughout = any(parts[trial.window] == _PARTS for trial in informative)
    return throughout and all(trial.best < trial.violations / 2 for trial in informative)


def _of(resolution: Resolution, weight: float, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the fault of the events that a transform undoes, and that of the frames where it has the same effect."""
    cause, size = _CAUSES[resolution.transform], resolution.size
    of_events, of_frames = _support("events"), _support("frames")
    if cause == "time_offset":
        of_events, of_frames = whose_offset(size or 0.0, facts)
    # The more probable of the two streams has the whole weight of the trial, the other a share of it.
    events = Hypothesis(cause, "events", weight * of_events / max(of_events, of_frames), size)
    if cause not in _OF_FRAMES_TOO:
        return (events,)
    # A shift is measured in pixels of the events; a delay has one unit.
    px = rgb_px_per_event_px(facts) if cause == "spatial_offset" else 1.0
    opposite = None if size is None else -size * px
    return events, Hypothesis(cause, "rgb", weight * of_frames / max(of_events, of_frames), opposite)


def _support(row: str) -> float:
    return support(f"event_response.conservation.{row}")
