"""The table of faults knows each cause in each of its streams."""

from typing import get_type_hints

from fedora_qa.causes import CAUSES
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import RowRange, is_of_part
from fedora_qa.faults.pixels import PixelShift
from fedora_qa.faults.table import FAULTS, WithoutInverse, faults_of


def test_every_cause_is_in_the_table() -> None:
    """Each cause has, for each stream that it can affect, a class or the reason why there is none; no row is spare."""
    assert set(FAULTS) == {(name, stream) for name, cause in CAUSES.items() for stream in cause.streams}
    reasons = [entry.reason for entry in FAULTS.values() if isinstance(entry, WithoutInverse)]
    assert reasons
    assert all(reason.endswith(".") and len(reason) > 20 for reason in reasons)


def test_classes_are_of_their_cause() -> None:
    """A class that has one cause or one stream stands in rows of these alone."""
    for (cause, stream), entry in FAULTS.items():
        if isinstance(entry, WithoutInverse):
            continue
        assert entry
        for fault in entry:
            assert {"plant", "undo", "cause", "stream", "magnitude"} <= set(dir(fault))
            # Where it is no class variable it is a field, and dataclasses with slots have a descriptor for it.
            fixed_cause, fixed_stream = getattr(fault, "cause", None), getattr(fault, "stream", None)
            assert not isinstance(fixed_cause, str) or fixed_cause == cause
            assert not isinstance(fixed_stream, str) or fixed_stream == stream


def test_a_rate_of_flow_has_the_faults_of_flow() -> None:
    """Streams are looked up by family; a cause without an inverse has no class."""
    assert faults_of("flow_gain", "flow/10hz") == faults_of("flow_gain", "flow") != ()
    assert faults_of("frozen_frames", "rgb") == ()


def test_rows_are_those_of_a_part() -> None:
    """``is_of_part`` reads the field ``rows``: it is a range of rows of a stream, and nothing else."""
    of_part = 0
    for entry in FAULTS.values():
        for fault in () if isinstance(entry, WithoutInverse) else entry:
            kinds = get_type_hints(fault)
            of_part += "rows" in kinds
            assert kinds.get("rows", RowRange) in (RowRange, RowRange | None)
    assert of_part
    assert not is_of_part(PixelShift("rgb", 3, 4))
    assert is_of_part(ClockShift("rgb", 1.0, (3, 4)))
