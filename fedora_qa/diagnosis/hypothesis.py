"""A cause that would explain a finding, its support by rule (``support.toml``), and what proposals share.

Convention trials are made on single deviating fields of flow or pairs of depth frames; a cause must explain all of
these.
"""

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from types import MappingProxyType
from typing import Final, TypeVar

from fedora_qa.causes import stream_family
from fedora_qa.checks.flow_rate_deviations import FlowRateDeviations
from fedora_qa.checks.protocol import Statistic
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

FeatureType = TypeVar("FeatureType", bound=Feature)

ANY_CAUSE: Final = "any"
"""In place of a cause: any other fault of the stream would explain the finding as well."""

_SINGLE_FRAME_CAUSES: Final = ("swapped_frames", "frozen_frames", "dropped_samples", "teleport")
"""Faults of single frames: they affect some fields or pairs. Other faults affect all, or all from some time on."""

_MOST: Final = 0.5
_FEW: Final = 0.25
"""Shares of deviating fields or pairs: above the first, faults of single frames are less likely; below the second, the
other faults are less likely."""

_LEAST_SUPPORT: Final = 0.3
"""Causes that remove less than this share of the deviation are not named."""

_COMPARABLE: Final = 0.6
"""Least ratio of a cause's support to that of the best cause for the cause to be named."""

_MOST_HYPOTHESES: Final = 6


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A cause that would explain a finding, with its fitted size.

    Attributes
    ----------
    cause, stream
        As in ``fedora_qa.causes``; the cause may be ``ANY_CAUSE``.
    support
        How well the cause explains the deviation, 0 (not at all) to 1 (entirely).
    magnitude, unit, standard_error
        Fitted size in the unit of the cause, and its standard error. Positive where timestamps are too late or values
        too large; None where the cause has no size.
    is_joint
        Whether the finding shows several causes at once, this one among them: to undo it alone changes nothing.
    """

    cause: str
    stream: str
    support: float
    magnitude: float | None = None
    unit: str = ""
    standard_error: float | None = None
    is_joint: bool = False


Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Returns the hypotheses for an alarm of one check, best supported first.

It reads the features of the alarm's statistic and the facts of the file, no samples: diagnosis decodes nothing.
"""


def only_feature(features: Iterable[Feature], kind: type[FeatureType]) -> FeatureType:
    """Return the feature of a type that every statistic of a check has.

    Parameters
    ----------
    features
        Of one statistic.
    kind
        The type; of several features of it the first is returned.

    Returns
    -------
    FeatureType
        The feature.

    Raises
    ------
    StopIteration
        The statistic has no such feature: the check and its hypotheses contradict each other.
    """
    return next(feature for feature in features if isinstance(feature, kind))


@dataclass(frozen=True, slots=True)
class Support:
    """Support by a rule, with the reason for its value.

    Attributes
    ----------
    value
        0 to 1.
    reason
        Why the value is not another.
    """

    value: float
    reason: str


SUPPORT: Final[Mapping[str, Support]] = MappingProxyType({
    f"{subject}.{name}": Support(float(value), reason)
    for subject, section in tomllib.loads(
        resources.files("fedora_qa.diagnosis").joinpath("support.toml").read_text(encoding="utf-8")
    ).items()
    for name, (value, reason) in section.items()
})  # fmt: skip
"""By ``<subject>.<name>``: the sections and keys of support.toml."""


def support(name: str) -> float:
    """Return the number of a row of the table.

    Raises
    ------
    KeyError
        The table has no such row.
    """
    return SUPPORT[name].value


def support_of_extent(cause: str, share_off: float, *, lasts: bool = False) -> float:
    """Return the factor on the support of a cause for the share of deviating fields or pairs.

    A fault of single frames cannot affect most of them, and a fault of all frames does not leave most of them
    unaffected.

    Parameters
    ----------
    cause
        As in ``fedora_qa.causes``.
    share_off
        Share of the compared fields, or pairs of depth frames, that deviate, 0 to 1.
    lasts
        Whether those that deviate lie next to each other, and are more than a fault of single frames affects: another
        fault then held for a while, however short.

    Returns
    -------
    float
        1 for a likely extent, less for an unlikely one.
    """
    is_of_single_frames = cause in _SINGLE_FRAME_CAUSES
    unlikely = lasts or share_off > _MOST if is_of_single_frames else not lasts and share_off < _FEW
    return support("convention_trials.unlikely_extent") if unlikely else 1.0


def most_probable(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses with enough support, best supported first, six at most."""
    best = max((hypothesis.support for hypothesis in hypotheses), default=0.0)
    enough = [hypothesis for hypothesis in hypotheses if hypothesis.support >= max(_LEAST_SUPPORT, _COMPARABLE * best)]
    return tuple(sorted(enough, key=lambda hypothesis: -hypothesis.support)[:_MOST_HYPOTHESES])


def weakened(hypotheses: Iterable[Hypothesis], factor: float) -> list[Hypothesis]:
    """Return the hypotheses with their support multiplied by a factor.

    Parameters
    ----------
    hypotheses
        Of any check.
    factor
        0 to 1.

    Returns
    -------
    list[Hypothesis]
        In the same order.
    """
    return [replace(hypothesis, support=factor * hypothesis.support) for hypothesis in hypotheses]


def over_all_rates(
    statistic: Statistic, hypotheses_of: Callable[[Statistic], tuple[Hypothesis, ...]]
) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for a statistic; with stream ``flow`` where all of several rates have the same cause.

    Parameters
    ----------
    statistic
        With the feature ``FlowRateDeviations`` where there is more than one rate.
    hypotheses_of
        Returns the hypotheses for one statistic of the check, each of its own rate.

    Returns
    -------
    tuple
        In the order of ``hypotheses_of``.
    """
    hypotheses = hypotheses_of(statistic)
    for feature in statistic.features:
        if isinstance(feature, FlowRateDeviations):
            streams_of_cause: dict[str, set[str]] = {}
            for hypothesis in (h for deviation in feature.deviations for h in hypotheses_of(deviation)):
                streams_of_cause.setdefault(hypothesis.cause, set()).add(hypothesis.stream)
            # If one measured rate does not have the cause, the fault is one of single rates.
            common = {cause for cause, streams in streams_of_cause.items() if feature.rates <= streams}
            return tuple(
                replace(h, stream="flow") if stream_family(h.stream) == "flow" and h.cause in common else h
                for h in hypotheses
            )
    return hypotheses
