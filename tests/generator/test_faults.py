"""Planting: legal or refused, in a copy, complete or not at all, and nothing else is touched."""

import hashlib
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from fedora_generator.commands import fault as fault_command
from fedora_generator.errors import GeneratorError, OutputError
from fedora_generator.faults import BYTE_FAULTS, FAULTS, FaultError, legal_causes, legal_streams, plant_fault
from fedora_generator.faults.fault import default_unit
from fedora_generator.faults.table import usual_stream
from fedora_qa.causes import CAUSES, allowed
from fedora_qa.layout.canonical import FLOW_STREAMS, datasets_of
from tests.generator.tiny_sequence import declare_noise, write_tiny_sequence

MAGNITUDES = {"quantised_time": 3.0, "interpolated_pose": 50.0}
NEVER_PLANTED = {"unknown"}
MAPS = {"metadata/rgb_to_event", "metadata/depth_to_event"}


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clean") / "clean.h5"
    write_tiny_sequence(path, origin_us=1_790_000_000_000_000)
    declare_noise(path)
    return path


@pytest.fixture(scope="module")
def donor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another sequence: the same one two seconds later."""
    path = tmp_path_factory.mktemp("donor") / "donor.h5"
    write_tiny_sequence(path, origin_us=1_790_000_002_000_000)
    return path


@pytest.fixture(scope="module")
def clean_content(clean: Path) -> dict[str, object]:
    return content(clean)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def content(path: Path) -> dict[str, object]:
    """Bytes, type and shape of every dataset, and every attribute, by name."""
    found: dict[str, object] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = (item.shape, item.dtype.str, item[...].tobytes())
        for attribute, value in item.attrs.items():
            found[f"{name}@{attribute}"] = (np.asarray(value).dtype.kind, np.asarray(value).tolist())

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def changed(before: dict[str, object], after: dict[str, object]) -> set[str]:
    """Names of what differs, is gone or is new; an attribute of a dataset counts as its dataset."""
    names = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    owners = {name: name.split("@")[0] for name in names}
    return {owner if owner in before | after else name for name, owner in owners.items()}


def may_change(cause: str, stream: str) -> set[str]:
    """What the fault is allowed to touch."""
    owned = {spec.key for each in (FLOW_STREAMS if stream == "flow" else (stream,)) for spec in datasets_of(each)}
    return owned | MAPS if stream in ("events", "rgb", "depth") else owned


@pytest.mark.parametrize(("cause", "stream"), list(FAULTS), ids=lambda part: part)
def test_a_fault_changes_its_stream_and_nothing_else(
    clean: Path, donor: Path, clean_content: dict[str, object], tmp_path: Path, cause: str, stream: str
) -> None:
    """Something of the stream changes; every other dataset and attribute keeps its bytes, type and shape."""
    source_digest, target = digest(clean), tmp_path / "faulty.h5"
    plant_fault(clean, target, cause, stream, MAGNITUDES.get(cause, 2.0), seed=3, donor=donor)
    differing = changed(clean_content, content(target))
    assert differing
    if stream == "metadata" or "misdeclared" in cause:
        assert all(name.startswith("metadata/") for name in differing)
    else:
        assert differing <= may_change(cause, stream)
        assert differing & {spec.key for each in (*FLOW_STREAMS, stream) for spec in datasets_of(each)}
    assert digest(clean) == source_digest
    assert [path.name for path in tmp_path.iterdir()] == ["faulty.h5"]


def test_every_legal_pair_is_one_that_the_causes_allow() -> None:
    """The table plants nothing that causes.py does not know, and leaves out only what no file could show."""
    pairs = [pair for pair in (*FAULTS, *BYTE_FAULTS) if pair != ("truncated", "file")]
    assert [pair for pair in pairs if not allowed(*pair)] == []
    assert set(CAUSES) - set(legal_causes()) == NEVER_PLANTED


def test_the_same_seed_plants_the_same_fault(clean: Path, tmp_path: Path) -> None:
    """Hot pixels repeat with their seed, and move with another."""
    contents = []
    for number, seed in enumerate((1, 1, 2)):
        plant_fault(clean, tmp_path / f"{number}.h5", "hot_pixels", "events", 3, seed=seed)
        contents.append(content(tmp_path / f"{number}.h5"))
    assert contents[0] == contents[1] != contents[2]


def test_one_flow_rate_can_be_named(clean: Path, tmp_path: Path) -> None:
    """``flow/25hz`` breaks that rate alone."""
    plant_fault(clean, tmp_path / "faulty.h5", "flow_sign", "flow/25hz")
    assert changed(content(clean), content(tmp_path / "faulty.h5")) == {"path/flow/25hz"}


def test_the_only_stream_need_not_be_named(clean: Path, tmp_path: Path) -> None:
    """A cause of one stream befalls it; the help of the command lists every cause."""
    assert usual_stream("time_offset") == "events"
    done = CliRunner().invoke(fault_command, [str(clean), "quaternion_order", "-o", str(tmp_path / "faulty.h5")])
    assert done.exit_code == 0, done.output
    assert changed(content(clean), content(tmp_path / "faulty.h5")) == {"path/pose/orientation"}
    listed = (fault_command.epilog or "").removeprefix("Causes: ").removesuffix(".").split(", ")
    assert listed == list(legal_causes())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("time_ofset", "events", 2), "time_offset"),
        (("quaternion_order", "events", 1), "choose from pose"),
        (("time_offset", "lidar", 1), "flow/10hz"),
        (("time_offset", "events", 2, "m"), "in ms, got 'm'"),
        (("time_offset", "events"), "Expected a magnitude for time_offset, in ms"),
        (("time_offset", "events", 0), "other than 0"),
        (("dropped_samples", "rgb", 10_000), "lower the magnitude"),
        (("dropped_samples", "events", 10_000), "within the sequence"),
        (("dead_region", "events", 50), "at most 9 px"),
        (("hot_pixels", "events", 1.5), "whole"),
        (("interpolated_pose", "pose", 900), "below the stream's own"),
        (("truncated", "events", 101), "up to 100 percent"),
        (("corrupt_chunk", "pose", 99), "at most the 1 chunks"),
    ],
)
def test_what_cannot_be_planted_is_refused(
    clean: Path, tmp_path: Path, arguments: tuple[str, str], message: str
) -> None:
    """An unknown cause or stream gets the legal ones; a wrong unit or size says why; nothing is left behind."""
    with pytest.raises(FaultError, match=message):
        plant_fault(clean, tmp_path / "faulty.h5", *arguments)
    assert list(tmp_path.iterdir()) == []


def test_noise_cannot_be_misdeclared_where_none_is_declared(tmp_path: Path) -> None:
    """A fault that would change nothing is refused."""
    source = tmp_path / "clean.h5"
    write_tiny_sequence(source)
    for cause, stream in (("noise_misdeclared", "pose"), ("flow_from_noisy_pose", "flow")):
        with pytest.raises(FaultError, match="noise"):
            plant_fault(source, tmp_path / "faulty.h5", cause, stream, 10)


def test_source_is_never_the_target(clean: Path, tmp_path: Path) -> None:
    """Planting in place is refused, also through a link; so are a source that is no HDF5 file and a lost folder."""
    link = tmp_path / "link.h5"
    link.symlink_to(clean)
    text = tmp_path / "text.h5"
    text.write_text("no")
    for source, target in ((clean, clean), (clean, link), (text, tmp_path / "x.h5"), (clean, tmp_path / "no" / "x.h5")):
        with pytest.raises(GeneratorError, match="Expected"):
            plant_fault(source, target, "time_offset", "events", 2)


def test_a_missing_stream_cannot_be_broken(clean: Path, tmp_path: Path) -> None:
    """A file without poses gets no pose fault, nor one that needs the attitude."""
    plant_fault(clean, tmp_path / "no_pose.h5", "missing_stream", "pose")
    for cause, stream in (("teleport", "pose"), ("gravity_missing", "imu"), ("time_offset", "pose")):
        with pytest.raises(FaultError, match="Expected"):
            plant_fault(tmp_path / "no_pose.h5", tmp_path / "x.h5", cause, stream, 1)


def test_command_plants_with_its_defaults(clean: Path, tmp_path: Path) -> None:
    """Without stream and unit, 2 is events late by 2 ms; the outcome goes to stderr."""
    target = tmp_path / "late.h5"
    result = CliRunner().invoke(fault_command, [str(clean), "time_offset", "--magnitude", "2", "-o", str(target)])
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "events:time_offset 2 ms" in result.stderr
    with h5py.File(clean) as before, h5py.File(target) as after:
        np.testing.assert_array_equal(after["path/events/t"][...] - before["path/events/t"][...], 2_000)


def test_command_refuses_misuse_with_exit_code_2(clean: Path, tmp_path: Path) -> None:
    """Through the entry point: an unknown cause is one line with the legal ones, exit code 2, no traceback."""
    script = "from fedora_generator.cli import main; main()"
    command = [sys.executable, "-c", script, "fault", str(clean), "no_such_cause", "-o", str(tmp_path / "x.h5")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "polarity_inverted" in result.stderr


def test_command_replaces_a_file_only_by_force(clean: Path, tmp_path: Path) -> None:
    """An existing output is left alone, unless --force says to replace it."""
    existing = tmp_path / "existing.h5"
    existing.write_text("mine")
    command = [str(clean), "time_offset", "--magnitude", "-2", "-o", str(existing)]
    assert isinstance(CliRunner().invoke(fault_command, command).exception, OutputError)
    assert existing.read_text() == "mine"
    assert CliRunner().invoke(fault_command, [*command, "--force"]).exit_code == 0
    assert h5py.is_hdf5(existing)


def test_legal_streams_name_the_flow_rates() -> None:
    """``flow`` is followed by its rates; a truncation can also befall the whole file."""
    assert legal_streams("flow_gain") == ("flow", *FLOW_STREAMS)
    assert "file" in legal_streams("truncated")
    assert default_unit("dropped_samples", "events") == "ms"
    assert default_unit("dropped_samples", "imu") == "samples"
