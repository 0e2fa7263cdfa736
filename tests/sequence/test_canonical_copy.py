"""Sequences of any layout as one canonical file: values, types and declarations are those that were read."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.progress import quiet
from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import T_BODY_IMU, load_choice
from fedora_qa.sequence.canonical_copy import CanonicalCopy, canonical_file, write_canonical
from fedora_qa.sequence.sequence import open_sequence
from tests.support.dsec_folder import write_dsec_folder


def copy(source: Path, target: Path, side: Path | None = None) -> CanonicalCopy:
    """Write a sequence as one file."""
    choice = load_choice(None, str(side) if side else None)
    with open_sequence(source, choice) as sequence, h5py.File(target, "w") as file:
        return write_canonical(sequence, file, quiet)


def test_a_canonical_file_stays_what_it_is(tiny_park_day: Path, tmp_path: Path) -> None:
    """Every dataset and every attribute that is read, in the same types, chunks and filters."""
    written = copy(tiny_park_day, tmp_path / "copy.h5")
    assert (written.left_out, written.beside) == ({}, None)
    names: list[str] = []
    with h5py.File(tiny_park_day) as before, h5py.File(tmp_path / "copy.h5") as after:
        before.visit(names.append)
        for name in names:
            old, new = before[name], after[name]
            for attribute, value in old.attrs.items():
                np.testing.assert_array_equal(new.attrs[attribute], value, err_msg=f"{name}.{attribute}")
            if isinstance(old, h5py.Dataset):
                np.testing.assert_array_equal(new[...], old[...], err_msg=name)
                assert (new.dtype, new.chunks, new.fletcher32) == (old.dtype, old.chunks, old.fletcher32)
        assert {key: after.attrs[key] for key in ("format", "world", "sequence", "illumination")} == {
            key: before.attrs[key] for key in ("format", "world", "sequence", "illumination")
        }
        assert written.rows["events"] == len(before["path/events/t"])


def test_a_folder_becomes_one_file(tiny_park_day: Path, tmp_path: Path) -> None:
    """What is read from the file is what is read from the folder; what has another definition is left out."""
    folder = write_dsec_folder(tiny_park_day, tmp_path / "dsec")
    written = copy(folder, tmp_path / "copy.h5")
    assert set(written.left_out) == {"metadata/ms_to_event"}
    with open_sequence(folder) as before, open_sequence(tmp_path / "copy.h5") as after:
        assert after.layout.dialect_name == "fedora"
        assert after.origin_ns == before.origin_ns
        assert set(before.layout.bindings) - set(after.layout.bindings) == {"metadata/ms_to_event"}
        for key in ("path/rgb", "path/depth", "path/events/t", "path/events/x", "path/flow/10hz", "path/flow/10hz_ts"):
            rows = before.layout.bindings[key].rows
            np.testing.assert_array_equal(after.rows(key, 0, rows), before.rows(key, 0, rows), err_msg=key)
        assert before.declared.rectify_map_px is not None
        np.testing.assert_array_equal(after.declared.rectify_map_px, before.declared.rectify_map_px)
        assert set(after.declared.cameras) == set(before.declared.cameras)
        for name, camera in before.declared.cameras.items():
            np.testing.assert_array_equal(after.declared.cameras[name].K, camera.K)
            assert after.declared.cameras[name].lens == camera.lens
        assert (after.declared.kind, after.declared.events) == (before.declared.kind, None)


def test_what_has_no_place_is_declared_beside(tiny_park_day: Path, tmp_path: Path) -> None:
    """A mounting of the IMU is no attribute of the layout: the copy is read with it."""
    side = tmp_path / "side.toml"
    side.write_text(f'[metadata]\n"{T_BODY_IMU}" = [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n')
    choice = load_choice(None, str(side))
    assert copy(tiny_park_day, tmp_path / "copy.h5", side).beside is not None
    with canonical_file(tiny_park_day, choice, tmp_path, quiet) as (file, read_as):
        assert file.parent.parent == tmp_path
        with open_sequence(file, read_as) as sequence:
            assert sequence.declared.imu_lever_body_m == (0.5, 0.0, 0.0)
    assert not file.exists()


def test_a_value_that_does_not_fit_is_named(tiny_park_day: Path, tmp_path: Path) -> None:
    """A column below zero has no place in 16 bits without a sign."""
    changed = tmp_path / "changed.h5"
    changed.write_bytes(tiny_park_day.read_bytes())
    with h5py.File(changed, "a") as file:
        columns = file["path/events/x"][...].astype(np.int32)
        columns[7] = -3
        del file["path/events/x"]
        file["path/events/x"] = columns
    with pytest.raises(MisuseError, match=r"path/events/x to fit uint16.* at 7"):
        copy(changed, tmp_path / "copy.h5")
