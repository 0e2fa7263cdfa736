"""Faults alter what is read, whatever pieces it is read in, and nothing else."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.catalogue import CATALOGUE, canary_of
from fedora_qa.engine.survey import prepare
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, FaultySequence, rows_from, values_by_row
from fedora_qa.record.types import Measurement
from fedora_qa.sequence.sequence import Sequence, open_sequence
from tests.support.handmade import write_handmade

ROWS = 12
STORED = np.arange(ROWS * 2.0).reshape(ROWS, 2)


def read(start: int, stop: int) -> NDArray[Any]:
    return STORED[start:stop]


def measured(name: str, least_detectable: float | None) -> Measurement:
    return Measurement(name, 0.0, "ms", 1.0, 0.0, 1.0, least_detectable)


@given(st.lists(st.integers(-3, ROWS + 3), min_size=ROWS, max_size=ROWS), st.lists(st.integers(0, ROWS)))
def test_rows_from_is_the_same_in_any_pieces(source: list[int], cuts: list[int]) -> None:
    """Rows come from where the source says, or stay where that is outside, however reading is cut."""
    wanted = np.array(source)
    alter = rows_from(lambda rows: wanted[rows], ROWS)
    inside = np.where((wanted >= 0) & (wanted < ROWS), wanted, np.arange(ROWS))
    edges = [0, *sorted(cuts), ROWS]
    pieces = [alter(read, start, stop) for start, stop in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(pieces), STORED[inside])


@given(st.integers(0, ROWS), st.integers(0, ROWS))
def test_values_by_row_sees_the_row_numbers_of_the_dataset(one: int, other: int) -> None:
    """The numbers count from the first row of the dataset, not of what is read."""
    start, stop = sorted((one, other))
    seen = values_by_row(lambda values, rows: values + rows[:, np.newaxis])(read, start, stop)
    np.testing.assert_array_equal(seen, STORED[start:stop] + np.arange(start, stop)[:, np.newaxis])


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A small file with something in every pixel, so that whatever moves or scales is seen to."""
    path: Path = write_handmade(tmp_path_factory.mktemp("faults") / "whole.h5")
    random = np.random.default_rng(1)
    with h5py.File(path, "r+") as file:
        for key in ("path/rgb", "path/depth", "path/flow/10hz", "path/flow/25hz", "path/flow/50hz"):
            stored = file[key]
            stored[:] = (stored[:] + random.uniform(1, 100, stored.shape)).astype(stored.dtype)
        file["metadata/ms_to_event"] = np.searchsorted(file["path/events/t"][:], 1000 * np.arange(100))
    with open_sequence(path) as opened:
        yield opened


@pytest.fixture(scope="module")
def conditions(sequence: Sequence) -> CanaryConditions:
    """The file, with every limit that a canary may ask for at a size that its values can carry."""
    names = ("imu.rate_error", "imu.missing", "imu.begins_late", "events.grid", "gap", "loudest_pixel_excess",
             "threshold_on", "time_offset", "shift_right", "gain", "endpoint_error", "by 25hz error", "deviation",
             "scale", "jitter", "position_jump", "bias_x", "repeats", "position_noise", "gyro_noise")  # fmt: skip
    facts = prepare(sequence, 1 << 26).facts
    measurements = tuple(Measurement(name, 0.0, "", 0.1, 1.0, 0.5, 1.0) for name in names)
    return CanaryConditions(sequence, facts, measurements, place_ns=50_000_000, multiple=3.0)


@pytest.mark.parametrize("check", CATALOGUE)
@pytest.mark.parametrize("cut", [0.0, 0.3])
def test_fault_does_not_depend_on_pieces(
    check: str, cut: float, sequence: Sequence, conditions: CanaryConditions
) -> None:
    """Every fault alters something; its rows are as many as stored, and the same read in one piece or in two."""
    canary = canary_of(check)
    assert canary is not None
    fault = canary(conditions)
    faulty = FaultySequence(sequence, fault)
    assert fault.rows or fault.declared is not None or fault.layout is not None
    assert faulty.declared is (fault.declared or sequence.declared)
    for key in sequence.layout.bindings:
        count = sequence.layout.bindings[key].rows
        stored = sequence.rows(key, 0, count)
        if check == "integrity.readable" and key in fault.rows:
            with pytest.raises(UnreadableRowsError):
                faulty.rows(key, 0, count)
            continue
        whole, middle = faulty.rows(key, 0, count), round(cut * count)
        parts = [faulty.rows(key, 0, middle), faulty.rows(key, middle, count)]
        assert whole.shape == stored.shape
        np.testing.assert_array_equal(np.concatenate(parts), whole)
        np.testing.assert_array_equal(stored, sequence.rows(key, 0, count))
        if key in fault.rows:
            assert not np.array_equal(whole, stored, equal_nan=stored.dtype.kind == "f")
        else:
            np.testing.assert_array_equal(whole, stored)


def test_size_is_clearly_above_the_sharpest_limit() -> None:
    """Of all measurements with the name the sharpest counts; a floor holds where it is higher."""
    sequence: Any = None
    facts: Any = None
    limits = (measured("imu time_offset", 2.0), measured("time_offset", 0.5), measured("other", 0.1))
    conditions = CanaryConditions(sequence, facts, limits, 0, multiple=3.0)
    assert conditions.size("time_offset") == 1.5
    assert conditions.size("time_offset", at_least=4.0) == 4.0
    assert conditions.size("unheard", at_least=1.0) == 1.0


@pytest.mark.parametrize("limit", [None, 0.0])
def test_no_size_without_a_limit(limit: float | None) -> None:
    """Where a check states no limit there is no fault that it would have to see."""
    sequence: Any = None
    facts: Any = None
    with pytest.raises(UnplantableError, match="no limit of gap"):
        CanaryConditions(sequence, facts, (measured("gap", limit),), 0, multiple=3.0).size("gap")


def test_only_timestamps_and_index_maps_move_time() -> None:
    """Whatever else is altered, windows stay as they are."""
    moving = {key for key in ("path/events/t", "path/imu/ts", "path/flow/10hz_ts", "metadata/rgb_to_event",
                              "path/events/x", "path/rgb", "path/flow/10hz")
              if Fault("", {key: values_by_row(lambda values, rows: values)}).moves_time}  # fmt: skip
    assert moving == {"path/events/t", "path/imu/ts", "path/flow/10hz_ts", "metadata/rgb_to_event"}
