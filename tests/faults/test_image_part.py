"""A fault of pixels holds in a rectangle alone: undone there, the rest of the image is as it was."""

import numpy as np
import pytest

from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import FaultySequence, InapplicableError, is_of_part
from fedora_qa.faults.flow import FlowIntervalShift
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.images import RayLength
from fedora_qa.faults.pixels import PixelShift, SwappedPixelAxes
from fedora_qa.repairs.mechanical import why_not_mechanical
from tests.support.memory_sequence import all_rows, facts_of, memory_sequence

REGION = (2, 1, 7, 6)
INSIDE = (slice(None), slice(1, 6), slice(2, 7))
DEPTH, FLOW, X, Y = "path/depth", "path/flow/50hz", "path/events/x", "path/events/y"


def test_values_of_the_rectangle_go_back() -> None:
    """Lengths of rays in the rectangle become depths there; all other values stay bit for bit."""
    clean, part = memory_sequence(), ImagePart(RayLength(), REGION)
    faulty = FaultySequence(clean, part.plant(facts_of(clean), clean))
    planted, stored = all_rows(faulty)[DEPTH], clean.arrays[DEPTH]
    beside = np.ones(stored.shape, bool)
    beside[INSIDE] = False
    np.testing.assert_array_equal(planted[beside], stored[beside])
    assert not np.array_equal(planted[INSIDE], stored[INSIDE], equal_nan=True)
    undone = all_rows(FaultySequence(faulty, part.undo(facts_of(clean), faulty)))[DEPTH]
    np.testing.assert_allclose(undone, stored, rtol=1e-5)
    assert (part.cause, part.stream, part.magnitude) == ("depth_ray_not_z", "depth", None)


def test_what_a_shift_moved_out_of_the_rectangle_is_lost() -> None:
    """Pixels whose values lay beside the rectangle are NaN, and no value from beside it enters."""
    clean = memory_sequence()
    shifted = clean.arrays[DEPTH].copy()
    shifted[:, 1:6, 4:7] = clean.arrays[DEPTH][:, 1:6, 2:5]
    faulty = clean.altered(path__depth=shifted)
    undoing = ImagePart(PixelShift("depth", 2), REGION).undo(facts_of(faulty), faulty)
    rows, stored = all_rows(FaultySequence(faulty, undoing))[DEPTH], clean.arrays[DEPTH]
    np.testing.assert_array_equal(rows[:, 1:6, 2:5], stored[:, 1:6, 2:5])
    assert np.all(np.isnan(rows[:, 1:6, 5:7]))
    np.testing.assert_array_equal(rows[:, :, 7:], stored[:, :, 7:])
    assert "columns 2 to 6, rows 1 to 5" in undoing.description


def test_events_stay_in_the_rectangle() -> None:
    """Axes are exchanged of the events that lie in the rectangle before and after."""
    sequence = memory_sequence()
    part = ImagePart(SwappedPixelAxes("events"), REGION)
    rows = all_rows(FaultySequence(sequence, part.undo(facts_of(sequence), sequence)))
    x, y = (sequence.arrays[key].astype(int) for key in (X, Y))
    exchanged = (x >= 2) & (x < 6) & (y >= 2) & (y < 6)
    np.testing.assert_array_equal(rows[X], np.where(exchanged, y, x))
    np.testing.assert_array_equal(rows[Y], np.where(exchanged, x, y))


def test_a_clock_has_no_rectangle() -> None:
    """Timestamps have no pixels. What holds in a part excludes nothing, and is not repaired."""
    sequence, part = memory_sequence(), ImagePart(ClockShift("depth", 1e6), REGION)
    with pytest.raises(InapplicableError):
        part.undo(facts_of(sequence), sequence)
    assert is_of_part(part)
    assert why_not_mechanical(part)


def test_fields_of_a_while_go_back_to_their_interval() -> None:
    """Fields that were stored one row late for a while are where they were; the last of these is lost."""
    clean = memory_sequence()
    stored, times_ns = clean.arrays[FLOW], facts_of(clean).clocks["flow/50hz"].times_ns
    late = stored.copy()
    late[1:4] = stored[:3]
    faulty = clean.altered(path__flow__50hz=late)
    fault = FlowIntervalShift("flow/50hz", 1, (int(times_ns[1]), int(times_ns[3])))
    rows = all_rows(FaultySequence(faulty, fault.undo(facts_of(faulty), faulty)))[FLOW]
    np.testing.assert_array_equal(np.delete(rows, 3, axis=0), np.delete(stored, 3, axis=0))
    assert np.all(np.isnan(rows[3]))
    assert is_of_part(fault)
    assert not is_of_part(FlowIntervalShift("flow/50hz", 1))
