"""The balance of events against changes of the light, of windows, and the features that its estimates make."""

from dataclasses import dataclass
from math import inf
from typing import Literal

import numpy as np

from fedora_qa.estimators.events.balance import BalanceSums, sum_balance
from fedora_qa.estimators.events.balance_estimates import (
    GainEstimate,
    concentration,
    gain_across,
    gain_over_time,
    response_line,
    silent_share,
    threshold_spread,
)
from fedora_qa.estimators.events.change_courses import FEWEST_INTERVALS
from fedora_qa.features import Feature
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import resampled_frames, signal


@dataclass(frozen=True, slots=True)
class EventBalance(Feature):
    """Events that came for the changes of the light that frames state, over the windows in which inverses are tried.

    Attributes
    ----------
    gain
        Events for an event that is due: below 1 where events are missing, above where they are in excess.
    growth
        Further events for each further threshold of a change, relative to the gain.
    scatter
        Variance of the events that each further event adds: 1 less the gain where events were lost at random.
    spread
        Variance of the thresholds of pixels, relative to their square.
    silent_share
        Share of the missing events in tiles that give none in an interval in which they are due.
    """

    gain: GainEstimate
    growth: GainEstimate
    scatter: GainEstimate
    spread: GainEstimate
    silent_share: float


@dataclass(frozen=True, slots=True)
class BalanceCourse(Feature):
    """How the gain of the events differs over the time of the windows, or across the image.

    Attributes
    ----------
    over
        Whether it differs in a part of the time, along the time or along the image.
    contrast
        Difference of the gains of the part and of the rest, or of both ends.
    usual
        Gain of the rest, or in the middle.
    scatter
        Variance of the events that each further event adds, in the part or in all.
    """

    over: Literal["part", "time", "image"]
    contrast: GainEstimate
    usual: float
    scatter: GainEstimate


@dataclass(frozen=True, slots=True)
class EventsAgainstChange(Feature):
    """Events against a change of the light that keeps its sign: of an ideal sensor there are none.

    Attributes
    ----------
    events
        Their number.
    rate_hz
        Of a pixel.
    column_share
        Share of them in a few columns.
    """

    events: int
    rate_hz: float
    column_share: float


def window_balance(window: Window, model: EventModel) -> BalanceSums:
    """Return the sums of a window with two frames or more."""
    resampled = resampled_frames(window)
    thresholds, intervals_ns = (model.threshold_off, model.threshold_on), np.diff(resampled.times_ns)
    return sum_balance(*signal(resampled, model), resampled.counts, thresholds, intervals_ns)


def balance_features(sums: BalanceSums | None) -> tuple[Feature, ...]:
    """Return the features of the events that came for the changes of the light.

    Parameters
    ----------
    sums
        Of windows in the order of time; None where there is none.

    Returns
    -------
    tuple
        None where few changes are large.
    """
    if sums is None:
        return ()
    line = response_line(sums.moments)
    events, seconds = int(sums.against.sum()), float(sums.seconds.sum())
    features: list[Feature] = []
    if seconds > 0:
        column_share = concentration(sums.columns_against.sum(axis=0))
        features.append(EventsAgainstChange(events, events / seconds, column_share))
    if line is None:
        return tuple(features)
    spread = threshold_spread(sums.agreement)
    features.append(EventBalance(line.gain, line.growth, line.scatter, spread, silent_share(sums.moments)))
    over_time, across = gain_over_time(sums.moments, FEWEST_INTERVALS), gain_across(sums.moments)
    if over_time is not None:
        of_part = response_line(sums.moments[over_time.first : over_time.stop])
        scatter = GainEstimate(0.0, inf) if of_part is None else of_part.scatter
        over: Literal["part", "time"] = "time" if over_time.is_trend else "part"
        features.append(BalanceCourse(over, over_time.contrast, over_time.usual, scatter))
    if across is not None:
        features.append(BalanceCourse("image", across.contrast, across.usual, line.scatter))
    return tuple(features)
