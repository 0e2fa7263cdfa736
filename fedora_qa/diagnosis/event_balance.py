"""Hypotheses by the balance of events against the changes of the light: what their gain and its scatter measure.

The gain differs from 1 by other thresholds and by lost events alike. Events that are lost at random scatter about the
line of events against changes by a binomial variance, 1 - gain for each event that is left; other thresholds leave the
scatter of an ideal pixel. So the scatter decides, and its error states whether it can; ``estimators/events/balance.py``
derives both.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import expm1, log, sqrt
from typing import Final

from fedora_qa.checks.event_response.conservation import LoneEventRate, ViolationCluster, Violations
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.estimators.events.balance_estimates import GainEstimate
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import EventModel
from fedora_qa.views.event_balance import BalanceCourse, EventBalance, EventsAgainstChange

_SIGMAS: Final = 5.0
"""Standard errors from which a gain that differs, or a count, is no chance, of all places and times."""

_DECIDES: Final = 3.0
"""Least logarithm of the ratio of two likelihoods by which one of two values is decided: 20 to 1. Not derived."""

_OF_MODEL: Final = 0.15
"""Largest deviation of the gain of correct files from 1, or from that of other times, relative: by changes that turn
within an interval, and by rounding. Not derived: of three scenes the largest was 0.09, by a tenth of the time."""

_OF_LINEAR_MODEL: Final = 0.25
"""The same for the linear model, whose reference is the last value: a fast change gives fewer events."""

_ACROSS: Final = 0.3
"""The same across the image. Not derived: of three scenes the largest was 0.19."""

_REVERSED: Final = -0.5
"""Ratio of gains below which events have the opposite sign."""

_MOSTLY: Final = 0.5
"""Share of what is missing, or in excess, from which its place names the cause."""

_SAME_PIXELS: Final = 0.02
"""Largest variance of the gains of pixels, relative, by changes that turn within an interval: a spread of 14%. The
value is not derived."""

_LEAST_HZ: Final = 0.1
"""Rate of events against the light of correct files, by changes that turn within an interval. Not derived: of three
scenes without noise the largest was 0.01 Hz."""

_OF_FRAMES_ALONE: Final = ("images.order.", "images.repeats.", "images.exposure.jump", "images.exposure.blank")
"""Beginnings of the codes of findings that no fault of the events causes: frames of another time, or of another light,
change by what they do not show at their times."""


def without_balance_of_wrong_frames(alarms: Sequence[Alarm]) -> tuple[Alarm, ...]:
    """Return the alarms of a file, without the balance of the events where the frames are wrong by themselves.

    The balance takes the changes of the frames for those of the light. Of wrong frames it states nothing of the events.

    Parameters
    ----------
    alarms
        Of one file.
    """
    if not any(alarm.finding.code.startswith(_OF_FRAMES_ALONE) for alarm in alarms):
        return tuple(alarms)
    return tuple(
        replace(alarm, statistic=replace(alarm.statistic, features=tuple(
            feature for feature in alarm.statistic.features
            if not isinstance(feature, EventBalance | BalanceCourse | EventsAgainstChange)
        )))
        for alarm in alarms
    )  # fmt: skip


def hypotheses_of_balance(features: Iterable[Feature], declared: EventModel | None) -> tuple[Hypothesis, ...]:
    """Return the causes that the balance of the events measures; none where it decides nothing.

    Parameters
    ----------
    features
        Of an alarm of ``event_response.conservation``.
    declared
        The declared event sensor.
    """
    by_type = {type(feature): feature for feature in features if not isinstance(feature, BalanceCourse)}
    courses = {feature.over: feature for feature in features if isinstance(feature, BalanceCourse)}
    balance, against = by_type.get(EventBalance), by_type.get(EventsAgainstChange)
    if declared is None or not isinstance(balance, EventBalance):
        return ()
    # Tiles without any event say nothing of the gain of others: their events were lost as a whole.
    if balance.silent_share > _MOSTLY:
        return ()
    part = _significant(courses.get("part"), _OF_MODEL)
    if part is not None and _is_reversed(part):
        return (Hypothesis("polarity_inverted", "events", _support("reversed_for_a_while")),)
    of_model = _OF_LINEAR_MODEL if declared.model == "linear" else _OF_MODEL
    differing = (part, _significant(courses.get("time"), _OF_MODEL), _significant(courses.get("image"), _ACROSS))
    varies = max((c for c in differing if c), key=lambda c: abs(c.contrast.value) / c.usual, default=None)
    differs = varies is not None or abs(balance.gain.value - 1.0) > of_model
    if isinstance(against, EventsAgainstChange) and _is_spurious(against, declared):
        # Neither lost events nor other thresholds leave events against the light; frames of another place or time do.
        return _of_spurious(against, balance, by_type, declared, of_model) if varies is None else ()
    spread = balance.spread
    if spread.value > max(_SIGMAS * spread.error, _SAME_PIXELS):
        # Other causes that hold in the same pixels over time leave events missing, and dead pixels have none.
        cluster = by_type.get(ViolationCluster)
        fire = isinstance(cluster, ViolationCluster) and cluster.fraction_without_events < _MOSTLY
        of_pixels = Hypothesis("threshold_misdeclared", "events", _support("thresholds_of_pixels"))
        return (of_pixels,) if fire and abs(balance.gain.value - 1.0) < of_model else ()
    return _of_gain(varies, balance) if differs else ()


def _of_gain(varies: BalanceCourse | None, balance: EventBalance) -> tuple[Hypothesis, ...]:
    """Return lost events or other thresholds, by the scatter of events whose number is another than is due."""
    # A pixel that gives one event at most for some time gives no more of a larger change.
    if _favours(0.0, 1.0, balance.growth):
        return (Hypothesis("dropped_samples", "events", _support("events_do_not_grow")),)
    gain, scatter = _of_what_differs(varies, balance)
    # A loss at random scatters by 1 - gain, thresholds by nothing; smaller thresholds are no loss.
    if 0.0 < gain < 1.0 and _favours(1.0 - gain, 0.0, scatter):
        return (Hypothesis("dropped_samples", "events", _support("binomial_scatter")),)
    # That of the whole file, alike everywhere, is what ``event_response.threshold`` measures.
    if varies is not None and gain > 0.0 and _favours(0.0, abs(1.0 - gain), scatter):
        # Declared over true, less 1: the gain.
        percent = 100.0 * (gain - 1.0)
        of_gain = _support("gain_without_scatter")
        return (Hypothesis("threshold_misdeclared", "events", of_gain, percent, "percent"),)
    return ()


def _favours(value: float, other: float, estimate: GainEstimate) -> bool:
    """Whether an estimate is far more likely for a true value than for another one, of a normal distribution."""
    apart = (estimate.value - other) ** 2 - (estimate.value - value) ** 2
    return apart > 2 * _DECIDES * estimate.error**2


def is_reversed_for_a_while(features: Iterable[Feature]) -> bool:
    """Whether events follow the light with the opposite sign in a part of the time.

    Parameters
    ----------
    features
        Of any alarm.
    """
    parts = (_significant(each, _OF_MODEL) for each in features if isinstance(each, BalanceCourse))
    return any(part is not None and part.over == "part" and _is_reversed(part) for part in parts)


def _is_reversed(part: BalanceCourse) -> bool:
    return part.usual + part.contrast.value < _REVERSED * part.usual


def _significant(course: BalanceCourse | None, least: float) -> BalanceCourse | None:
    """Return a course whose contrast exceeds its error and what correct files have; None for another."""
    if course is None or course.usual <= 0:
        return None
    size = abs(course.contrast.value)
    return course if size > max(_SIGMAS * course.contrast.error, least * course.usual) else None


def _of_what_differs(varies: BalanceCourse | None, balance: EventBalance) -> tuple[float, GainEstimate]:
    """Return the gain of the part that differs, relative to the rest, or of all, and its scatter."""
    if varies is None or varies.over != "part":
        return balance.gain.value, balance.scatter
    inside = varies.usual + varies.contrast.value
    # The part may be what is right, of a fault that lasts longer than it.
    if inside > 0.0 and abs(log(inside)) < abs(log(varies.usual)):
        return varies.usual / inside, balance.scatter
    return inside / varies.usual, varies.scatter


def _declared_hz(declared: EventModel) -> float:
    """Return the rate of declared noise against the light: as many spurious events come with a change as against it."""
    return (declared.shot_rate_hz + declared.leak_rate_hz) / 2


def has_spurious_events(features: Iterable[Feature], declared: EventModel | None) -> bool:
    """Whether more events come against a light that keeps its sign than those of the declared noise.

    Lost events, of whatever region, leave none.

    Parameters
    ----------
    features
        Of an alarm of ``event_response.conservation``.
    declared
        The declared event sensor.
    """
    return declared is not None and any(
        isinstance(feature, EventsAgainstChange) and _is_spurious(feature, declared) for feature in features
    )


def _is_spurious(against: EventsAgainstChange, declared: EventModel) -> bool:
    """Whether more events come against the light than by chance of the declared noise, and by changes that turn."""
    seconds = against.events / against.rate_hz if against.rate_hz else 0.0
    expected = seconds * _declared_hz(declared)
    return against.events - expected > max(_SIGMAS * sqrt(expected + 1.0), _LEAST_HZ * seconds)


def _of_spurious(
    against: EventsAgainstChange,
    balance: EventBalance,
    by_type: dict[type[Feature], Feature],
    declared: EventModel,
    of_model: float,
) -> tuple[Hypothesis, ...]:
    """Return noise, or pixels that fire, where more events come against the light than are declared."""
    violations, rate = by_type.get(Violations), by_type.get(LoneEventRate)
    if isinstance(violations, Violations) and isinstance(rate, LoneEventRate):
        # A pixel with a spurious event may violate the law; others do not.
        disturbed = -expm1(-2 * (against.rate_hz - _declared_hz(declared)) * rate.seconds)
        if violations.fraction > disturbed:
            return ()
    if against.column_share > _MOSTLY:
        return (Hypothesis("hot_pixels", "events", _support("columns_fire")),)
    keeps_gain = abs(balance.gain.value - 1.0) < of_model
    row = "events_against_the_light" if keeps_gain else "events_undone"
    return (Hypothesis("noise_misdeclared", "events", _support(row)),)


def _support(row: str) -> float:
    return support(f"event_response.balance.{row}")
