"""The part in which flow deviates, of the image and of the time."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.image_parts import fewest_fields_off, part_of_images, part_of_time
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.flow import FlowIntervalShift
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.pixels import Mirroring
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where

FAST, SLOW = "flow/50hz", "flow/10hz"
FACTS: Any = SimpleNamespace(
    clocks={FAST: SimpleNamespace(times_ns=20 * np.arange(25)), SLOW: SimpleNamespace(times_ns=100 * np.arange(5))},
    flow_streams=(SLOW, FAST),
    streams=frozenset({SLOW, FAST}),
    layout=SimpleNamespace(
        bindings={f"path/{rate}": SimpleNamespace(shape=(5, 137, 180, 2)) for rate in ("flow/50hz", "flow/10hz")}
    ),
)


def alarm(stream: str, feature: Feature) -> Alarm:
    """Make an alarm of a rate of flow."""
    where, code = Where(stream=stream), "flow_geometry.endpoint.error"
    statistic = Statistic("error", 1.0, "px", 0.0, "off", code, where, features=(feature,))
    return Alarm(Finding("F1", code, "error", "off", where), statistic)


def fields_off(count: int, part: tuple[int, int, int, int] | None, first_ns: int = 0, last_ns: int = 480) -> FieldsOff:
    """Make the extent of a deviation."""
    return FieldsOff(count, 1.0, part is not None, 0, 0, part, first_ns, last_ns)


def test_the_rectangle_holds_all_that_deviates() -> None:
    """Lattices of several fields, and values that are there or not, state the edges together; clocks have none."""
    alarms = [alarm(SLOW, fields_off(5, (45, 36, 134, 101))), alarm(FAST, fields_off(25, (46, 35, 135, 102)))]
    assert part_of_images(alarms, "flow") == (45, 35, 135, 102)
    assert part_of_images(alarms, FAST) == (46, 35, 135, 102)
    assert part_of_images(alarms, "rgb") is None
    values = WrongFlowValues(frozenset({FAST}), 1, 1, 0, 0, deep=True, part=(50, 34, 60, 40))
    assert part_of_images([*alarms, alarm(FAST, values)], "depth") == (45, 34, 135, 102)
    faults = list(faults_for("mirrored", "flow", None, alarms, {}, FACTS))
    assert faults[0] == ImagePart(Mirroring("flow", "horizontal"), (45, 35, 135, 102))


@pytest.mark.parametrize(("left", "directions"), [(45, ["horizontal", "vertical", "both"]), (91, ["vertical"])])
def test_a_part_is_mirrored_only_where_it_holds_its_mirror_image(left: int, directions: list[str]) -> None:
    """Mirrored about the middle of the image, a part beside it becomes NaN, and findings vanish with its pixels."""
    part = (left, 20, left + 80, 117)
    faults = list(faults_for("mirrored", "flow", None, [alarm(FAST, fields_off(25, part))], {}, FACTS))
    of_part = [fault.fault for fault in faults if isinstance(fault, ImagePart)]
    assert [fault.direction for fault in of_part if isinstance(fault, Mirroring)] == directions


def test_a_rate_that_deviates_as_a_whole_has_no_rectangle() -> None:
    """A fault of the whole image deviates little in a part of it at times."""
    alarms = [alarm(SLOW, fields_off(5, None)), alarm(FAST, fields_off(25, (46, 35, 135, 102)))]
    assert part_of_images(alarms, "flow") is None
    assert part_of_images([], "flow") is None


def test_fields_that_deviate_for_a_while_are_a_part_of_the_time() -> None:
    """All fields between the first and the last one deviate, at every rate; single ones are no part."""
    alarms = [alarm(SLOW, fields_off(2, None, 200, 300)), alarm(FAST, fields_off(12, None, 140, 360))]
    assert part_of_time(alarms, "flow", FACTS) == (140, 360)
    assert fewest_fields_off(alarms, "flow") == 2
    assert part_of_time([alarm(FAST, fields_off(25, None))], FAST, FACTS) is None
    frozen = [alarm(SLOW, fields_off(3, None, 100, 300)), alarm(FAST, fields_off(3, None, 200, 240))]
    assert part_of_time(frozen, "flow", FACTS) is None


def test_fields_of_a_while_move_within_it() -> None:
    """The part is tried before the whole, but not where most of its values would be lost."""
    alarms = [alarm(SLOW, fields_off(2, None, 200, 300)), alarm(FAST, fields_off(12, None, 140, 360))]
    whole = FlowIntervalShift("flow", 1)
    faults = list(faults_for("flow_interval_shifted", "flow", 1.0, alarms, {}, FACTS))
    assert faults == [FlowIntervalShift("flow", 1, (140, 360)), whole]
    assert not list(faults_for("flow_interval_shifted", "flow", 2.0, alarms, {}, FACTS))
