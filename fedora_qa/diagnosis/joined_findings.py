"""Hypotheses for a finding that another finding of the same file explains: what one check alone cannot tell."""

from collections.abc import Mapping, Sequence
from typing import Final

from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.checks.images.exposure import BrightnessJump
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.judgement.judge import Alarm

_NEARLY_BLACK_PERCENT: Final = -90.0
"""Change of brightness from which a frame of 8 bits shows no motion: 25 of 255 levels are left for all of the scene,
most of which is darker than white. The value is not derived."""


def joined_hypotheses(alarms: Sequence[Alarm]) -> Mapping[str, tuple[Hypothesis, ...]]:
    """Return further causes of findings, by their id.

    Frames that are nearly black show no motion: what ``images.order`` finds of them is the exposure. Flow that is
    absent where depth is valid, and nowhere else wrong, was made of a depth without these values; where the depth
    contradicts itself as well, it has values that are none.

    Parameters
    ----------
    alarms
        Of one file.
    """
    features = [feature for alarm in alarms for feature in alarm.statistic.features]
    joined: dict[str, tuple[Hypothesis, ...]] = {}
    if any(isinstance(each, BrightnessJump) and each.percent < _NEARLY_BLACK_PERCENT for each in features):
        black = Hypothesis("exposure_or_gamma", "rgb", support("images.order_of_black_frames"))
        joined |= {alarm.finding.id: (black,) for alarm in alarms if alarm.finding.code.startswith("images.order.")}
    values = [each for each in features if isinstance(each, WrongFlowValues)]
    of_pairs = [alarm for alarm in alarms if alarm.finding.code.startswith("depth.consistency.")]
    if of_pairs and values and all(each.missing and not each.unfounded for each in values):
        filled = Hypothesis("invalid_encoding", "depth", support("depth.values_without_flow"))
        of_values = (alarm for alarm in alarms if alarm.finding.code == "flow_geometry.validity.missing")
        joined |= {alarm.finding.id: (filled,) for alarm in (*of_pairs, *of_values)}
    return joined
