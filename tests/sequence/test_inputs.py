"""What a result is made from is noted as it is read."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from fedora_qa.sequence.declared import Declared, EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.inputs import InputLog, TracedFields, changed_inputs
from fedora_qa.sequence.stored_step import StoredStep
from tests.support.facts import clock, exact_facts, with_clock

FACTS = exact_facts()


def test_a_result_has_the_inputs_of_those_within_it() -> None:
    """What was read before for another result does not count."""
    log = InputLog()

    def inner() -> int:
        log.note("path/depth")
        return 1

    def outer() -> int:
        log.note("path/rgb")
        return log.trace(inner).value + 1

    traced = log.trace(outer)
    assert (traced.value, traced.inputs) == (2, {"path/depth", "path/rgb"})
    assert log.trace(lambda: 0).inputs == set()


def test_what_fails_within_a_result_is_an_input_of_it() -> None:
    """A check may do without an image that cannot be decoded."""
    log = InputLog()

    def fail() -> None:
        log.note("path/depth")
        raise ValueError("damaged")

    def outer() -> None:
        with pytest.raises(ValueError, match="damaged"):
            log.trace(fail)

    assert log.trace(outer).inputs == {"path/depth"}


def test_facts_note_each_part_that_is_read() -> None:
    """Clocks one by one, also through a property of the facts; declarations field by field."""
    log = InputLog()
    facts = cast(Facts, TracedFields(FACTS, "facts", log))

    def read() -> Any:
        return facts.clocks["imu"], "flow/10hz" in facts.clocks, facts.flow_streams, facts.declared.events

    imu, has_flow, streams, events = log.trace(read).value
    assert imu is FACTS.clocks["imu"]
    assert has_flow
    assert streams == FACTS.flow_streams
    assert events is FACTS.declared.events
    expected = {"facts.clocks.imu", "facts.clocks.flow/10hz", "facts.streams", "facts.declared.events"}
    assert log.trace(read).inputs == expected
    assert log.trace(lambda: list(facts.clocks)).inputs == {"facts.clocks"}
    assert log.trace(lambda: facts.to_file_us(0)).inputs == {"facts.origin_us"}


LATE = with_clock(FACTS, "imu", clock(FACTS.clocks["imu"].times_ns + 1))
SAME = with_clock(FACTS, "imu", clock(FACTS.clocks["imu"].times_ns.copy()))
WITHOUT_IMU = replace(FACTS, clocks={name: each for name, each in FACTS.clocks.items() if name != "imu"})


@pytest.mark.parametrize(
    ("after", "changed"),
    [
        (FACTS, set()),
        (SAME, set()),
        (LATE, {"facts.clocks.imu"}),
        (WITHOUT_IMU, {"facts.clocks", "facts.clocks.imu"}),
        (replace(FACTS, declared=Declared(events=EventModel("log", 0.2, 0.3))), {"facts.declared.events"}),
        (replace(FACTS, declared=replace(FACTS.declared, transfer="srgb")), {"facts.declared.transfer"}),
        (replace(FACTS, sizes={"path/rgb": 3}), {"facts.sizes", "facts.sizes.path/rgb"}),
    ],
)
def test_changed_facts_have_the_names_that_are_noted(after: Facts, changed: set[str]) -> None:
    """Arrays count by their values, and an entry that is gone as one whose absence can be read."""
    assert set(changed_inputs(FACTS, after, "facts")) == changed


def test_fields_that_do_not_count_in_comparisons_are_inputs_too() -> None:
    """Two steps are equal whatever their typical value; a result may be made from it."""
    before, after = (replace(FACTS, steps={"path/depth": StoredStep(1.0, typical=size)}) for size in (1.0, 2.0))
    assert before.steps == after.steps
    assert set(changed_inputs(before, after, "facts")) == {"facts.steps.path/depth"}


def test_values_that_are_not_numbers_are_the_same() -> None:
    """NaN equals NaN where bits are compared."""
    before, after = (
        replace(FACTS, declared=replace(FACTS.declared, rectify_map_px=np.full((1, 1, 2), np.nan, np.float32)))
        for _ in range(2)
    )
    assert set(changed_inputs(before, after, "facts")) == set()
