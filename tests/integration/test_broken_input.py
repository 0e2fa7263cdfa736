"""The worst files there are: a clear message, the right exit code, no traceback, nothing half written."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.cli.main import run
from tests.support.sequences import CleanSequence, make_sequence

Mutation = Callable[[Path, Path], None]


def edited(edit: Callable[[h5py.File], None]) -> Mutation:
    """A mutation that edits a copy of the clean file."""

    def mutate(clean: Path, target: Path) -> None:
        shutil.copy(clean, target)
        with h5py.File(target, "r+") as file:
            edit(file)

    return mutate


def replace_dataset(file: h5py.File, key: str, values: np.ndarray) -> None:
    units = file[key].attrs["units"]
    del file[key]
    file.create_dataset(key, data=values).attrs["units"] = units


def lose_imu(file: h5py.File) -> None:
    del file["path/imu"]


def float16_gyro(file: h5py.File) -> None:
    replace_dataset(file, "path/imu/angular_velocity", file["path/imu/angular_velocity"][:].astype(np.float16))


def nan_in_gyro(file: h5py.File) -> None:
    file["path/imu/angular_velocity"][100, 1] = np.nan


def no_events(file: h5py.File) -> None:
    for name in "xytp":
        file[f"path/events/{name}"].resize((0,))
    for name in ("rgb_to_event", "depth_to_event"):
        file[f"metadata/{name}"][:] = 0


def fractional_timestamps(file: h5py.File) -> None:
    replace_dataset(file, "path/imu/ts", file["path/imu/ts"][:] + 0.25)


def quaternions_of_three(file: h5py.File) -> None:
    replace_dataset(file, "path/pose/orientation", file["path/pose/orientation"][:, :3])


def text_file(clean: Path, target: Path) -> None:
    target.write_text("this is no sequence\n")


def truncated(clean: Path, target: Path) -> None:
    content = clean.read_bytes()
    target.write_bytes(content[: len(content) // 2])


def signature_only(clean: Path, target: Path) -> None:
    target.write_bytes(clean.read_bytes()[:8])


def nothing(clean: Path, target: Path) -> None:
    """Leave no file at all."""


def folder(clean: Path, target: Path) -> None:
    target.mkdir()


BROKEN: dict[str, tuple[Mutation, int, str]] = {
    "no such path": (nothing, 2, "does not exist"),
    "a folder": (folder, 2, "folder"),
    "a text file": (text_file, 2, "no HDF5 signature"),
    "a truncated file": (truncated, 1, "file truncated"),
    "a signature and nothing else": (signature_only, 1, "file corrupt_chunk"),
    "a missing group": (edited(lose_imu), 1, "imu missing_stream"),
    "a wrong type": (edited(float16_gyro), 1, "imu wrong_dtype"),
    "a wrong shape": (edited(quaternions_of_three), 1, "pose wrong_shape"),
    "a NaN in the IMU": (edited(nan_in_gyro), 1, "imu nan_in_stream"),
    "zero events": (edited(no_events), 1, "events missing_stream"),
    "fractional microseconds": (edited(fractional_timestamps), 1, "imu wrong_dtype"),
}


@pytest.mark.parametrize(("mutate", "code", "said"), BROKEN.values(), ids=BROKEN)
def test_broken_file_is_named(
    mutate: Mutation,
    code: int,
    said: str,
    clean_sequence: CleanSequence,
    tiny_park_day: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The exit code is right, the message or a diagnosis says what is wrong, and only whole outputs are left."""
    target, record = tmp_path / "seq.h5", tmp_path / "record.json"
    # Only where enough changes in the frames is it certain that events are missing.
    mutate(clean_sequence("park-day") if said.startswith("events") else tiny_park_day, target)
    assert run(["check", str(target), "--json", str(record)]) == code
    output = "".join(capsys.readouterr())
    assert "Traceback" not in output
    if code == 2:
        assert said in output
        assert not record.exists()
    else:
        held = json.loads(record.read_text())["files"][0]
        assert "crashed" not in {result["outcome"] for result in held["results"]}
        assert said in [f"{diagnosis['stream']} {diagnosis['cause']}" for diagnosis in held["diagnoses"]]
    assert {path.name for path in tmp_path.iterdir()} <= {"seq.h5", "record.json", "record.json.arrays.npz"}


def shift_to_epoch(file: h5py.File) -> None:
    """All stamps from the epoch on, as a recorder on a wall clock writes them."""

    def shift(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and name.endswith(("_ts", "/ts", "/t")):
            item[...] = item[...] + 1_726_000_000_000_000

    file.visititems(shift)


def test_epoch_timestamps_are_as_good_as_any(tiny_park_day: Path, tmp_path: Path) -> None:
    """Any int64 origin is legal: the same outcomes, to the last finding."""
    shifted, records = tmp_path / "epoch.h5", []
    edited(shift_to_epoch)(tiny_park_day, shifted)
    for path in (tiny_park_day, shifted):
        out = tmp_path / f"{path.stem}.json"
        assert run(["check", str(path), "--json", str(out)]) == 0
        records.append(json.loads(out.read_text())["files"][0])
    outcomes = [{r["check"]: r["outcome"] for r in record["results"]} for record in records]
    assert outcomes[0] == outcomes[1]


@pytest.mark.parametrize("duration_s", [0.001, 0.005, 0.02], ids=["one of each", "two poses", "two frames"])
def test_hardly_any_samples(duration_s: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sequence of one frame or two poses is neither a crash nor a false alarm."""
    path, record = tmp_path / "short.h5", tmp_path / "short.json"
    make_sequence(path, "park-day", duration_s=duration_s)
    assert run(["check", str(path), "--json", str(record)]) in {0, 3}
    assert "Traceback" not in "".join(capsys.readouterr())
    outcomes = {result["outcome"] for result in json.loads(record.read_text())["files"][0]["results"]}
    assert not outcomes & {"failed", "crashed"}
