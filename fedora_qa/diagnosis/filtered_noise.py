"""Noise that a filter or an interpolation has taken: the cause is that one, and not the declaration of the noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp
from typing import Final

from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.diagnosis.measured_sizes import Results, deviation, measured
from fedora_qa.judgement.judge import Alarm
from fedora_qa.views.sample_defects import FilteredNoise, SmoothInterpolation

_MS: Final = 1e3

_LATE: Final[Mapping[str, float]] = {"imu": 1.0, "pose": -1.0}
"""Sign of the offset that ``imu.timing`` measures where the values of a stream are late: it is that of the IMU."""


@dataclass(frozen=True, slots=True)
class NoiseTaken:
    """What has taken noise of a stream, and its share of the support of a declaration that is too large.

    Attributes
    ----------
    cause, stream
        As in ``fedora_qa.causes``.
    share
        0 to 1.
    magnitude
        In the unit of the cause; None where it has none.
    """

    cause: str
    stream: str
    share: float
    magnitude: float | None = None

    def divided(self, proposed: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Return hypotheses of one finding, where this one has its share of those of a declaration that is too large.

        The size of such a declaration is positive: less noise is measured.
        """
        divided: list[Hypothesis] = []
        for each in proposed:
            is_too_large = (each.cause, each.stream) == ("noise_misdeclared", self.stream) and (each.magnitude or 0) > 0
            if not is_too_large:
                divided.append(each)
                continue
            divided.append(replace(each, support=(1.0 - self.share) * each.support))
            divided.append(Hypothesis(self.cause, self.stream, self.share * each.support, self.magnitude))
        return divided


def noise_taken(alarms: Sequence[Alarm], results: Results) -> tuple[NoiseTaken, ...]:
    """Return what has taken noise of the streams: knots of an interpolation, or a filter that looks back.

    Noise that is white was declared wrongly. What is left of it by a filter states the delay of one that looks back;
    ``imu.timing`` measures the delay that there is, with an error of which noise makes milliseconds. The likelihoods of
    that delay and of none divide the support. The delay is stated without a size: moved timestamps do not bring the
    noise back, so that no trial of them decides.

    Parameters
    ----------
    alarms
        Of one file.
    results
        Of the file, by check, judged by the limits alone.
    """
    features = [feature for alarm in alarms for feature in alarm.statistic.features]
    interpolated = {
        each.stream: NoiseTaken("interpolated_pose", each.stream, support("motion.noise_of_knots"), each.knot_rate_hz)
        for each in features
        if isinstance(each, SmoothInterpolation)
    }
    filtered: dict[str, NoiseTaken] = {}
    for each in features:
        if isinstance(each, FilteredNoise) and each.stream not in {*interpolated, *filtered}:
            filtered[each.stream] = NoiseTaken("time_offset", each.stream, _share_of_delay(each, results))
    return (*interpolated.values(), *filtered.values())


def _share_of_delay(noise: FilteredNoise, results: Results) -> float:
    """Return how likely a filter looks back, by the offset that is measured; a filter that keeps all noise is none."""
    timing = results.get("imu.timing")
    offset = measured(timing, "time_offset")
    if offset is None or offset.value is None or not offset.standard_error:
        return (1.0 - noise.kept) / 2.0
    late_ms = _LATE[noise.stream] * deviation(timing, "time_offset")
    delay_ms = _MS * noise.delay_s
    # Logarithm of the likelihood of no delay over that of the delay, for a normal error of the offset.
    against = ((late_ms - delay_ms) ** 2 - late_ms**2) / (2.0 * offset.standard_error**2)
    return (1.0 - noise.kept) / (1.0 + exp(min(against, _MOST_EXPONENT)))


_MOST_EXPONENT: Final = 700.0
"""Largest exponent whose power is a finite float64."""
