"""Lossless variants of a correct file are read and noted; what they hold is measured as ever."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.cli.main import run
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import FileRecord
from tests.support.handmade import write_handmade

Edit = Callable[[h5py.File], None]


def stored_as(key: str, dtype: str, change: Callable[[Any], Any] = lambda rows: rows) -> Edit:
    """Store a dataset in another type, with its attributes."""

    def edit(file: h5py.File) -> None:
        rows, attributes = change(file[key][()]).astype(dtype), dict(file[key].attrs)
        del file[key]
        file.create_dataset(key, data=rows).attrs.update(attributes)

    return edit


def every_second_field(file: h5py.File) -> None:
    for key in ("path/flow/50hz", "path/flow/50hz_ts"):
        stored_as(key, file[key].dtype, lambda rows: rows[::2])(file)


def widths_as_floats(file: h5py.File) -> None:
    for name in ("rgb", "depth", "events"):
        for size in ("width", "height"):
            file[f"metadata/cameras/{name}"].attrs[size] = float(file[f"metadata/cameras/{name}"].attrs[size])


def labels_in_upper_case(file: h5py.File) -> None:
    for key in ("path/depth", "path/imu/ts", "path/flow/10hz"):
        file[key].attrs["units"] = file[key].attrs["units"].upper()


VARIANTS = {
    "depth in float64": stored_as("path/depth", "float64"),
    "IMU in float32": stored_as("path/imu/angular_velocity", "float32"),
    "polarity as bool": stored_as("path/events/p", "bool"),
    "signed polarity": stored_as("path/events/p", "int8", lambda p: 2 * p.astype(int) - 1),
    "columns in uint32": stored_as("path/events/x", "uint32"),
    "stamps in float64": stored_as("path/events/t", "float64"),
    "widths as floats": widths_as_floats,
    "labels in upper case": labels_in_upper_case,
    "sparse flow": every_second_field,
}


def outcomes(record: FileRecord) -> dict[str, str]:
    return {result.check: result.outcome for result in record.results}


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> FileRecord:
    return check_file(write_handmade(tmp_path_factory.mktemp("lenient") / "clean.h5"), CheckOptions()).record


@pytest.mark.parametrize("edit", VARIANTS.values(), ids=VARIANTS)
def test_a_lossless_variant_is_noted(edit: Edit, clean: FileRecord, tmp_path: Path) -> None:
    """No finding but warnings, and no other outcome changes."""
    with h5py.File(write_handmade(tmp_path / "variant.h5"), "r+") as file:
        edit(file)
    record = check_file(tmp_path / "variant.h5", CheckOptions()).record
    changed = {name for name, outcome in outcomes(record).items() if outcome != outcomes(clean)[name]}
    assert record.verdict == clean.verdict
    # Fields of one interval in two leave no chain that another rate could be composed of.
    if outcomes(record)["flow_rates.composition"] == "not_observable":
        changed -= {"flow_rates.composition"}
    assert changed
    assert changed <= {"integrity.layout", "metadata.complete", "metadata.units", "clocks.rate"}
    assert {outcomes(record)[name] for name in changed} == {"warned"}


def test_a_layout_that_nothing_describes_is_incomplete(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit 3, one sentence with the command that drafts a dialect, and no finding."""
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["camera/left/stamps"] = np.arange(9)
    record = check_file(path, CheckOptions()).record
    assert (record.verdict, record.diagnoses) == ("incomplete", ())
    assert not [finding for result in record.results for finding in result.findings]
    assert run(["check", str(path)]) == 3
    said = " ".join(capsys.readouterr().out.split())
    assert "incomplete: layout not recognised" in said
    assert "--draft-dialect" in said
