"""Files of other makers are repaired in their own units, types and tables."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.faults.clocks import ClockShift, TimeUnit
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.faults.images import ChannelOrder, InvalidCode
from fedora_qa.faults.pixels import PolarityInversion, SwappedPixelAxes
from fedora_qa.faults.row_order import DuplicatedSamples, Unsorted
from fedora_qa.faults.units import LengthUnit
from fedora_qa.repairs.repair import repair
from fedora_qa.repairs.result import Repair
from tests.support.foreign import write_dsec, write_m3ed, write_mvsec, write_purdue_lab
from tests.support.handmade import write_handmade
from tests.support.repairs import given_check

MS = 1_000_000


def repaired(file: Path, *faults: ReversibleFault) -> tuple[Repair, Path]:
    """Repair a file whose faults are given, without measuring."""
    out = file.with_name("out.h5")
    return repair(file, out, CheckOptions(), quiet, check=given_check(file, *faults)), out


def values(file: Path, path: str) -> np.ndarray:
    """A dataset of a file."""
    with h5py.File(file) as opened:
        return np.asarray(opened[path])


def replace_rows(file: Path, path: str, rows: np.ndarray) -> None:
    """Write a dataset anew."""
    with h5py.File(file, "r+") as opened:
        attributes = dict(opened[path].attrs)
        del opened[path]
        opened[path] = rows
        opened[path].attrs.update(attributes)


def test_lab_events_shift_in_their_column(tmp_path: Path) -> None:
    """Float64 microseconds with fractions, in a table: its other columns keep their bits."""
    file = write_purdue_lab(tmp_path / "lab.hdf5")
    result, out = repaired(file, ClockShift("events", 2.5 * MS))
    assert not result.refusal
    table = values(file, "path/events")
    table[:, 2] -= 2500
    np.testing.assert_array_equal(values(out, "path/events"), table)


def test_lab_depth_stays_in_metres(tmp_path: Path) -> None:
    """It was written in millimetres, and the dialect reads metres."""
    file = write_purdue_lab(tmp_path / "lab.hdf5")
    true = values(file, "path/depth")
    replace_rows(file, "path/depth", true * 1000)
    result, out = repaired(file, LengthUnit("depth", 1000.0))
    assert not result.refusal
    np.testing.assert_allclose(values(out, "path/depth"), true, rtol=2.0**-23)


def test_lab_tables_are_sorted_and_shortened(tmp_path: Path) -> None:
    """Events are one table in contiguous storage: whole rows move, and copies go. Attributes of the table stay."""
    file = write_purdue_lab(tmp_path / "lab.hdf5")
    true = values(file, "path/events")
    replace_rows(file, "path/events", true[[2, 0, 1]])
    result, out = repaired(file, Unsorted("events", 0, 3))
    assert not result.refusal
    np.testing.assert_array_equal(values(out, "path/events"), true)
    out.unlink()
    replace_rows(file, "path/events", true[[0, 1, 1, 2, 2]])
    with h5py.File(file, "r+") as opened:
        opened["path/events"].attrs["maker"] = "lab"
        opened["path/events"].attrs["rate"] = np.array([1.5, 2.5])
    result, out = repaired(file, DuplicatedSamples("events"))
    assert not result.refusal
    assert [(each.path, each.removed) for each in result.datasets] == [("path/events", 2)]
    np.testing.assert_array_equal(values(out, "path/events"), true)
    with h5py.File(out) as opened:
        assert dict(opened["path/events"].attrs).keys() == {"maker", "rate"}
        assert opened["path/events"].attrs["maker"] == "lab"


def test_a_further_column_would_stay_behind(tmp_path: Path) -> None:
    """The table has a column that the dialect does not name."""
    file = write_purdue_lab(tmp_path / "lab.hdf5")
    table = values(file, "path/events")
    replace_rows(file, "path/events", np.column_stack([table, table[:, 0]])[[2, 0, 1]])
    result, _ = repaired(file, Unsorted("events", 0, 3))
    assert "further columns of path/events" in result.refusal
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_seconds_since_1970_keep_their_digits(tmp_path: Path) -> None:
    """MVSEC: a shift of float64 seconds by 31.25 ms, a number that binary fractions hold; polarity of both signs."""
    file = write_mvsec(tmp_path / "indoor_data.hdf5")
    result, out = repaired(file, ClockShift("rgb", 31.25 * MS), PolarityInversion())
    assert not result.refusal
    np.testing.assert_array_equal(
        values(out, "davis/left/image_raw_ts"), values(file, "davis/left/image_raw_ts") - 0.03125
    )
    events = values(file, "davis/left/events")
    events[:, 3] *= -1
    np.testing.assert_array_equal(values(out, "davis/left/events"), events)
    # Its map names the last event before each image, and follows.
    assert values(out, "davis/left/image_raw_event_inds").tolist() == [-1, -1]
    assert result.beside == ("davis/left/imu",)


def test_colour_of_a_grey_image_has_no_order(tmp_path: Path) -> None:
    """R = G = B: nothing changes."""
    result, _ = repaired(write_mvsec(tmp_path / "indoor_data.hdf5"), ChannelOrder("BGR"))
    assert "it changes none" in result.refusal


def test_unsigned_microseconds_count_from_their_offset(tmp_path: Path) -> None:
    """DSEC: 32 bits from ``t_offset``; a shift before it does not fit."""
    file = write_dsec(tmp_path / "events.h5")
    result, out = repaired(file, ClockShift("events", 0.005 * MS))
    assert not result.refusal
    np.testing.assert_array_equal(values(out, "events/t"), np.array([5, 15], np.uint32))
    out.unlink()
    result, _ = repaired(file, ClockShift("events", 1 * MS))
    assert "got uint32 for numbers from -990" in result.refusal


def test_milliseconds_follow_the_repaired_events(tmp_path: Path) -> None:
    """DSEC: ``ms_to_idx`` counts from ``t_offset``; made of late events it follows, made of the true ones it stays."""
    file, true = write_dsec(tmp_path / "events.h5"), [0, 1, 1, 2, 2]
    replace_rows(file, "events/t", np.array([1500, 3500], np.uint32))
    for entries in ([0, 0, 1, 1, 2], true):
        replace_rows(file, "ms_to_idx", np.array(entries, np.uint64))
        result, out = repaired(file, ClockShift("events", 1 * MS))
        assert not result.refusal
        np.testing.assert_array_equal(values(out, "events/t"), [500, 2500])
        assert values(out, "ms_to_idx").tolist() == true
        out.unlink()


def test_axes_are_exchanged_in_other_places(tmp_path: Path) -> None:
    """M3ED: columns and rows of events, by their own names."""
    file = write_m3ed(tmp_path / "data.h5")
    result, out = repaired(file, SwappedPixelAxes("events"))
    assert not result.refusal
    np.testing.assert_array_equal(values(out, "prophesee/left/x"), values(file, "prophesee/left/y"))
    np.testing.assert_array_equal(values(out, "prophesee/left/y"), values(file, "prophesee/left/x"))


@pytest.mark.parametrize("dtype", [np.bool_, np.uint8, np.int64, np.float32])
def test_polarity_of_other_types(dtype: type[np.generic], tmp_path: Path) -> None:
    """1 and 0 are exchanged, in the type that the file has."""
    file = write_handmade(tmp_path / "seq.h5")
    true = values(file, "path/events/p")
    replace_rows(file, "path/events/p", (1 - true).astype(dtype))
    result, out = repaired(file, PolarityInversion())
    assert not result.refusal
    stored = values(out, "path/events/p")
    assert stored.dtype == dtype
    np.testing.assert_array_equal(stored, true)


def test_a_label_of_the_unit_follows(tmp_path: Path) -> None:
    """Metres, labelled so in a layout of millimetres, become millimetres."""
    file = write_handmade(tmp_path / "seq.h5")
    true = values(file, "path/depth")
    replace_rows(file, "path/depth", true / np.float32(1000))
    with h5py.File(file, "r+") as opened:
        opened["path/depth"].attrs["units"] = "m"
    result, out = repaired(file, LengthUnit("depth", 0.001))
    assert result.attributes == ("path/depth.units = mm",)
    np.testing.assert_allclose(values(out, "path/depth"), true, rtol=2.0**-23)
    with h5py.File(out) as opened:
        assert opened["path/depth"].attrs["units"] == "mm"


def test_whole_millimetres_have_no_nan(tmp_path: Path) -> None:
    """Depth of 16 bits: 0 cannot become NaN."""
    file = write_handmade(tmp_path / "seq.h5")
    replace_rows(file, "path/depth", np.nan_to_num(values(file, "path/depth")).astype(np.uint16) * 0)
    result, _ = repaired(file, InvalidCode("depth"))
    assert "got uint16 for NaN or infinity" in result.refusal
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_fractions_of_seconds_in_a_file_of_microseconds_are_refused(tmp_path: Path) -> None:
    """The IMU was stamped in float64 seconds, which are read as microseconds, to a nanosecond."""
    file = write_handmade(tmp_path / "seq.h5")
    replace_rows(file, "path/imu/ts", values(file, "path/imu/ts") * 1e-6)
    result, _ = repaired(file, TimeUnit("imu", 1e-6))
    assert "got 1000 us of their fractions; read the file by a dialect" in result.refusal
