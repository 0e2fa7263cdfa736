"""Alarms and results of failed checks, from which faults are proposed."""

from fedora_qa.checks.protocol import Statistic
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Measurement, Result, Where


def failed_result(check: str, **values: float) -> tuple[str, Result]:
    """A failed result of a check, by its name."""
    measurements = tuple(Measurement(name, value, "1", 0.1, 0.0, 0.2, 0.3) for name, value in values.items())
    return check, Result(check, "failed", "?", measurements=measurements)


def alarm(code: str, *features: Feature) -> Alarm:
    """An alarm of a rule, whose statistic has features."""
    statistic = Statistic("toy", 1.0, "1", 0.0, "off", code, Where(), features=features)
    return Alarm(Finding("F1", code, "error", "off", Where()), statistic)


RESULTS = dict(
    [
        failed_result("imu.rotation", bias_x=0.1, bias_y=-0.2, bias_z=0.05),
        failed_result("imu.translation", bias_x=0.1, bias_y=-0.2, bias_z=0.05, lever_x=0.3, lever_y=0.0, lever_z=-0.1),
        failed_result("event_response.threshold", threshold_on=25.0, threshold_off=-20.0),
        failed_result("images.channels", towards_BGR=0.9, towards_RBG=0.2),
        failed_result("images.transfer", exponent=2.2),
    ]
)


def pairs_alarm(first: int, last: int) -> Alarm:
    """Pairs of depth frames deviate, from that of the first frame to that of the last."""
    code, where = "depth.consistency.frame", Where(stream="depth", index_start=first, index_stop=last + 1)
    return Alarm(Finding("F1", code, "error", "off", where), Statistic("toy", 1.0, "1", 0.0, "off", code, where))
