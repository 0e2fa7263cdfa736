"""Depth at both ends of its range, and nowhere valid."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.extremes.files import FLOW_HZ, alarms, checks_of, edited, named, outcomes, passed, record_of
from tests.support.checked import checks_that_read

OF_DEPTH = [name for name in checks_of("depth") if not name.startswith("index_maps")]


def start_frames(file: h5py.File, rate_hz: int) -> np.ndarray:
    """The depth frame at which each field of a rate starts."""
    return np.searchsorted(file["path/depth_ts"][:], file[f"path/flow/{rate_hz}hz_ts"][:, 0])


def narrow_to_what_is_there(file: h5py.File) -> None:
    """Declare a range whose two ends lie within the scene, and leave out what lies beyond, from flow as well."""
    depth_mm = file["path/depth"][:]
    near_mm, far_mm = np.nanpercentile(depth_mm, [20, 80])
    depth_mm[~((depth_mm >= near_mm) & (depth_mm <= far_mm))] = np.nan
    file["path/depth"][...] = depth_mm
    file["metadata/depth_range"][...] = [near_mm / 1000, far_mm / 1000]
    for rate_hz in FLOW_HZ:
        flow_px = file[f"path/flow/{rate_hz}hz"][:]
        flow_px[np.isnan(depth_mm[start_frames(file, rate_hz)])] = np.nan
        file[f"path/flow/{rate_hz}hz"][...] = flow_px


def test_depth_up_to_both_ends_is_clean(half_second: Path, tmp_path: Path) -> None:
    """Right: surfaces that leave the range at either end through NaN are honest."""
    record = record_of(edited(half_second, tmp_path / "narrow.h5", narrow_to_what_is_there))
    assert not alarms(record)
    assert outcomes(record)["depth.range"] == "passed"


@pytest.mark.parametrize("end", [0, 1], ids=["near end", "far end"])
def test_depth_cut_off_at_an_end_is_named(end: int, half_second: Path, tmp_path: Path) -> None:
    """Right: pixels beyond an end that were set to it are cut off: depth, invalid encoding."""

    def cut_off(file: h5py.File) -> None:
        depth_mm = file["path/depth"][:]
        limit_mm = float(np.nanpercentile(depth_mm, [20, 80][end]))
        file["path/depth"][...] = (np.fmax if end == 0 else np.fmin)(depth_mm, np.float32(limit_mm))
        range_m = file["metadata/depth_range"][:]
        range_m[end] = np.float64(np.float32(limit_mm)) / 1000
        file["metadata/depth_range"][...] = range_m

    record = record_of(edited(half_second, tmp_path / "cut.h5", cut_off), *checks_that_read("depth"))
    assert outcomes(record)["depth.range"] == "failed"
    assert ("depth", "invalid_encoding") in named(record)


def no_depth(file: h5py.File) -> None:
    file["path/depth"][...] = np.nan


def no_depth_and_no_flow(file: h5py.File) -> None:
    no_depth(file)
    for rate_hz in FLOW_HZ:
        flow = file[f"path/flow/{rate_hz}hz"]
        flow[...] = np.full(flow.shape, np.nan)


def test_nowhere_valid_depth_is_said(half_second: Path, tmp_path: Path) -> None:
    """Right: a warning that nothing is valid; nothing passes but that flow is unknown where depth is."""
    record = record_of(edited(half_second, tmp_path / "none.h5", no_depth_and_no_flow))
    assert not alarms(record)
    assert outcomes(record)["integrity.finite"] == "warned"
    where_both_are_unknown = {"flow_geometry.validity"}
    assert set(passed(record, [*OF_DEPTH, *checks_of("flow")])) <= where_both_are_unknown


def test_flow_without_depth_is_found(half_second: Path, tmp_path: Path) -> None:
    """Right: flow where no depth is valid cannot have been made from it."""
    record = record_of(edited(half_second, tmp_path / "none.h5", no_depth), *checks_that_read("depth"))
    assert outcomes(record)["flow_geometry.validity"] == "failed"
    assert not passed(record, OF_DEPTH)
