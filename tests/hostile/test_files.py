"""Hostile files: never a crash, a hang, or more memory than they are worth; never clean about what was not seen."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
import pytest

from fedora_qa.cli.main import run
from tests.hostile import contents, links, patched, storage
from tests.hostile.conftest import Attacked, Edit

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that no float holds squared

LONGEST_S: Final = 20
"""Processor time; most take a third of a second."""

LAYOUT = "integrity.layout"

STORAGE: Final = {
    storage.petabytes_of_events: f"{LAYOUT}.unwritten",
    storage.petabytes_of_frames: f"{LAYOUT}.unwritten",
    storage.poses_never_written: f"{LAYOUT}.too_large",
    storage.frames_of_gigabytes: f"{LAYOUT}.too_large",
    storage.bomb_of_samples: f"{LAYOUT}.too_large",
    storage.bomb_of_events: f"{LAYOUT}.expands",
    storage.bomb_of_an_index_map: f"{LAYOUT}.too_large",
    storage.a_chunk_beyond_its_dataset: f"{LAYOUT}.too_large",
    storage.no_rows: f"{LAYOUT}.wrong_shape",
    storage.no_columns: f"{LAYOUT}.wrong_shape",
    storage.damaged_bitshuffle: "integrity.readable.chunk",
    storage.bitshuffle_within_gzip: f"{LAYOUT}.unsafe_filter",
}
LINKS: Final = {
    links.external_storage: f"{LAYOUT}.outside_link",
    links.virtual: f"{LAYOUT}.outside_link",
    links.external_link: f"{LAYOUT}.outside_link",
    links.external_metadata: f"{LAYOUT}.outside_link",
    links.soft_link_loops: f"{LAYOUT}.dangling_link",
    links.soft_links_without_end: f"{LAYOUT}.dangling_link",
    links.soft_link_of_thousands_of_steps: f"{LAYOUT}.wrong_shape",
    links.named_type_for_a_stream: f"{LAYOUT}.not_a_dataset",
    links.group_for_a_dataset: f"{LAYOUT}.not_a_dataset",
    links.dataset_for_a_group: f"{LAYOUT}.missing_stream",
}
CONTENTS: Final = {
    contents.compound_events: f"{LAYOUT}.missing_stream",
    contents.compound_timestamps: f"{LAYOUT}.wrong_dtype",
    contents.ragged: f"{LAYOUT}.wrong_dtype",
    contents.texts: f"{LAYOUT}.wrong_dtype",
    contents.types_without_like: f"{LAYOUT}.unreadable",
    contents.null_space: f"{LAYOUT}.wrong_shape",
    contents.sensor_without_bounds: "metadata.complete.malformed",
    contents.sensor_undeclared: f"{LAYOUT}.wrong_dtype",
    contents.cameras_without_bounds: "metadata.complete.malformed",
    contents.numbers_without_bounds: "metadata.complete.malformed",
    contents.numbers_of_nothing: "metadata.complete.malformed",
    contents.timestamps_at_the_ends: "integrity.finite.stamps_not_finite",
    contents.index_maps_out_of_bounds: "index_maps.depth",
    contents.one_text_many_times: "metadata.complete.malformed",
    contents.long_texts: "metadata.complete.malformed",
    contents.wrong_attributes: "metadata.complete.malformed",
    contents.hostile_names: f"{LAYOUT}.dangling_link",
}
TIMESTAMPS: Final = {
    "f2": "clocks",
    ">f4": LAYOUT,
    "i1": "clocks",
    "?": "clocks",
    "c16": LAYOUT,
    "S8": LAYOUT,
    "f16": LAYOUT,
}
PATCHED: Final = {
    patched.filter_that_nobody_has: f"{LAYOUT}.missing_filter",
    patched.chunks_beyond_the_end: f"{LAYOUT}.overlapping_chunks",
    patched.chunk_shorter_than_its_checksum: f"{LAYOUT}.short_chunk",
    patched.chunk_shorter_than_its_values: f"{LAYOUT}.short_chunk",
    patched.names_out_of_order: f"{LAYOUT}.unreadable",
    patched.names_of_a_flow_damaged: f"{LAYOUT}.unreadable",
}
HARMLESS: Final = (storage.a_chunk_for_each_value, storage.through_bitshuffle,
                   links.hard_link_cycle, links.deep_groups, links.many_datasets,
                   contents.names_that_are_not_text, contents.timestamps_as(">i8"))  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def compiled(clean_bytes: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Compile what a check needs before anybody's processor time is taken."""
    path = tmp_path_factory.mktemp("compiled") / "clean.h5"
    path.write_bytes(clean_bytes)
    assert run(["check", str(path)]) == 0


def checked(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """Check a file as a person does, hold what is said to what may be said, and return its record."""
    started, target = time.process_time(), path.with_suffix(".json")
    code = run(["check", str(path), "--json", str(target)])
    assert time.process_time() - started < LONGEST_S
    said = "".join(capsys.readouterr())
    assert "internal error" not in said
    assert "Traceback" not in said
    assert all(character.isprintable() or character == "\n" for character in said)
    assert len(said) < 40_000
    record: dict[str, Any] = json.loads(target.read_text())["files"][0]
    assert {"clean": 0, "findings": 1, "incomplete": 3}[record["verdict"]] == code
    assert [result["traceback"] for result in record["results"] if result["outcome"] == "crashed"] == []
    return record


def codes(record: dict[str, Any]) -> list[str]:
    return [finding["code"] for result in record["results"] for finding in result["findings"]]


def named(attack: Callable[..., None]) -> str:
    return attack.__name__


@pytest.mark.parametrize(("edit", "code"), [*STORAGE.items(), *LINKS.items(), *CONTENTS.items()],
                         ids=[named(edit) for edit in (*STORAGE, *LINKS, *CONTENTS)])  # fmt: skip
def test_an_attack_is_a_finding(edit: Edit, code: str, attacked: Attacked, capsys: pytest.CaptureFixture[str]) -> None:
    """What cannot be seen, or must not be, is named; the other checks go on."""
    record = checked(attacked(edit), capsys)
    assert record["verdict"] == "findings"
    assert any(found.startswith(code) for found in codes(record)), codes(record)


@pytest.mark.parametrize(("dtype", "subject"), TIMESTAMPS.items(), ids=TIMESTAMPS)
def test_timestamps_of_odd_types(
    dtype: str, subject: str, attacked: Attacked, capsys: pytest.CaptureFixture[str]
) -> None:
    """A type that cannot hold stamps is named, or what it made of them."""
    record = checked(attacked(contents.timestamps_as(dtype)), capsys)
    assert record["verdict"] == "findings"
    assert any(found.startswith(subject) for found in codes(record)), codes(record)


@pytest.mark.parametrize("rank", [0, 1, 5])
def test_streams_of_any_rank(rank: int, attacked: Attacked, capsys: pytest.CaptureFixture[str]) -> None:
    """Scalars, lists and blocks where images and samples should be."""
    record = checked(attacked(contents.with_axes(rank)), capsys)
    assert f"{LAYOUT}.wrong_shape" in codes(record)


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e300], ids=str)
@pytest.mark.parametrize("dtype", [None, "f8"], ids=["own type", "float64"])
def test_one_value_everywhere(
    value: float, dtype: str | None, attacked: Attacked, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every value of every stream is the same, and none."""
    if dtype is None and value == 1e300:
        value = 1e30  # float32 holds it
    assert checked(attacked(contents.filled(value, dtype)), capsys)["verdict"] == "findings"


@pytest.mark.parametrize("dtype", ["f2", "?", "i8"])
def test_one_type_everywhere(dtype: str, attacked: Attacked, capsys: pytest.CaptureFixture[str]) -> None:
    """Every stream is of one type."""
    assert LAYOUT + ".wrong_dtype" in codes(checked(attacked(contents.everything_as(dtype)), capsys))


@pytest.mark.parametrize(("patch", "code"), PATCHED.items(), ids=[named(patch) for patch in PATCHED])
def test_patched_bytes_are_a_finding(
    patch: Callable[[Path], None], code: str, clean_bytes: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What no library would write is named as well."""
    path = tmp_path / "patched.h5"
    path.write_bytes(clean_bytes)
    patch(path)
    record = checked(path, capsys)
    assert code in codes(record)


@pytest.mark.parametrize("edit", HARMLESS, ids=[named(edit) for edit in HARMLESS])
def test_what_is_odd_and_whole_is_clean(edit: Edit, attacked: Attacked, capsys: pytest.CaptureFixture[str]) -> None:
    """Objects beside the streams, and odd ways to store them, are no faults; and they cost little."""
    assert checked(attacked(edit), capsys)["verdict"] == "clean"


def test_a_claimed_attribute_is_malformed(
    clean_bytes: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An attribute that claims gigabytes is named, and never read."""
    path = tmp_path / "patched.h5"
    path.write_bytes(clean_bytes)
    patched.attribute_of_gigabytes(path)
    record = checked(path, capsys)
    reasons = {result["check"]: result["reason"] for result in record["results"]}
    assert "hot_pixels" in json.dumps([reasons["metadata.complete"], codes(record)]) + json.dumps(record["results"])


@pytest.mark.parametrize("patch", [patched.user_block, patched.signature_in_the_middle], ids=named)
def test_what_stands_around_a_file_is_not_read(
    patch: Callable[[Path], None], clean_bytes: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A user block, and bytes behind the end, change nothing."""
    path = tmp_path / "patched.h5"
    path.write_bytes(clean_bytes)
    patch(path)
    assert checked(path, capsys)["verdict"] == "clean"


@pytest.mark.parametrize("command", ["layout", "stats"])
@pytest.mark.parametrize("edit", [contents.hostile_names, contents.numbers_without_bounds,
                                  storage.petabytes_of_events], ids=named)  # fmt: skip
def test_other_commands(command: str, edit: Edit, attacked: Attacked, capsys: pytest.CaptureFixture[str]) -> None:
    """What describes a file is as safe as what checks it, and prints nothing that commands a terminal."""
    started = time.process_time()
    assert run([command, str(attacked(edit))]) == 0
    said = "".join(capsys.readouterr())
    assert all(character.isprintable() or character == "\n" for character in said)
    assert time.process_time() - started < LONGEST_S


def test_layout_says_what_it_did_not_look_at(attacked: Attacked, capsys: pytest.CaptureFixture[str]) -> None:
    """A walk that ended early says so, and why."""

    def edit(file: h5py.File) -> None:
        links.deep_groups(file, levels=100)
        links.many_datasets(file)
        contents.names_that_are_not_text(file)

    assert run(["layout", str(attacked(edit))]) == 0
    said = capsys.readouterr().out
    assert "Not examined" in said
    assert "deeper than 32" in said
    assert "names cannot be printed" in said
    assert "what follows the first 10000" in said
