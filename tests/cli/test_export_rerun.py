"""``fedora-qa export --to rerun``: what is read back from the recording is what the sequence and the record have."""

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
from rerun.chunk import RrdReader

from fedora_qa.exporting import rerun_recording
from tests.cli.conftest import Command
from tests.support.sequences import CleanSequence

LATE_US = 20_000


@pytest.fixture(scope="module")
def source(clean_sequence: CleanSequence, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Events are late, and time begins at an hour of its own."""
    path = tmp_path_factory.mktemp("source") / "late.h5"
    shutil.copyfile(clean_sequence("park-day"), path)
    with h5py.File(path, "a") as file:
        file["path/events/t"][:] += LATE_US
    return path


def rows_of(recording: Path, entity: str, *columns: str) -> Iterator[tuple[int, *tuple[Any, ...]]]:
    """Yield time, ns, and components of each row of an entity; of static ones nothing."""
    for chunk in RrdReader(str(recording)).stream():
        if chunk.entity_path == f"/{entity}" and not chunk.is_static:
            batch = chunk.to_record_batch()
            assert "log_time" not in batch.schema.names
            times = batch.column("sequence").cast("int64").to_pylist()
            yield from zip(times, *(batch.column(name).to_pylist() for name in columns), strict=True)


def image_of(content: Any) -> np.ndarray:
    return cv2.imdecode(np.array(content[0], np.uint8), cv2.IMREAD_UNCHANGED)


def test_streams_and_findings_lie_on_one_timeline(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """Images without loss, depth in whole mm, the net number of events as colour, findings at their times."""
    record, out = tmp_path / "record.json", tmp_path / "late.rrd"
    assert fedora_qa("check", source, "--json", record).code == 1
    done = fedora_qa("export", source, out, "--to", "rerun", "--record", record)
    assert done.code == 0, done.err
    with h5py.File(source) as file:
        origin_us = min(int(file[f"path/{name}"][0]) for name in ("rgb_ts", "imu/ts", "pose/ts", "events/t"))
        poses = sorted(rows_of(out, rerun_recording.BODY, "Transform3D:translation", "Transform3D:quaternion"))
        assert [time for time, *_ in poses] == (1000 * (file["path/pose/ts"][:] - origin_us)).tolist()
        np.testing.assert_allclose([p[0] for _, p, _ in poses], file["path/pose/position"], atol=1e-5)
        np.testing.assert_allclose([q[0] for *_, q in poses], file["path/pose/orientation"], atol=1e-6)
        forces = [f for _, f in sorted(rows_of(out, "imu/linear_acceleration", "Scalars:scalars"))]
        np.testing.assert_allclose(forces, file["path/imu/linear_acceleration"], atol=1e-12)
        frames = sorted(rows_of(out, f"{rerun_recording.BODY}/rgb", "EncodedImage:blob"), key=lambda row: row[0])
        assert [time for time, _ in frames] == (1000 * (file["path/rgb_ts"][:] - origin_us)).tolist()
        np.testing.assert_array_equal(image_of(frames[3][1])[..., ::-1], file["path/rgb"][3])
        depths = sorted(rows_of(out, f"{rerun_recording.BODY}/depth", "EncodedDepthImage:blob"), key=lambda row: row[0])
        expected_mm = np.rint(np.nan_to_num(file["path/depth"][2]).clip(0, 65535))
        np.testing.assert_array_equal(image_of(depths[2][1]), expected_mm)
        events = {name: file[f"path/events/{name}"][:] for name in "xytp"}
        begin_us, end_us = file["path/rgb_ts"][4:6]
    pictures = sorted(rows_of(out, rerun_recording.EVENTS, "EncodedImage:blob"), key=lambda row: row[0])
    chosen = (events["t"] > begin_us) & (events["t"] <= end_us)
    picture = image_of(pictures[5][1]).astype(int)
    net = np.zeros(picture.shape[:2], int)
    np.add.at(net, (events["y"][chosen], events["x"][chosen]), np.where(events["p"][chosen], 1, -1))
    assert net.any()
    # B, G, R: red alone is left of brighter pixels, blue alone of darker ones.
    np.testing.assert_array_equal(np.sign(picture[..., 2] - picture[..., 0]), np.sign(net))
    findings = json.loads(record.read_text())["files"][0]["results"]
    messages = {finding["message"] for result in findings for finding in result["findings"]}
    written = [text[0].partition(": ")[2] for _, text in rows_of(out, rerun_recording.FINDINGS, "TextLog:text")]
    assert messages
    assert set(written) == messages


def test_events_without_frames_have_pictures_of_their_own(fedora_qa: Command, source: Path, tmp_path: Path) -> None:
    """Every 20 ms, up to the last event."""
    path, out = tmp_path / "events.h5", tmp_path / "events.rrd"
    shutil.copyfile(source, path)
    with h5py.File(path, "a") as file:
        for key in ("path/rgb", "path/rgb_ts", "metadata/rgb_to_event"):
            del file[key]
        span_us = int(file["path/events/t"][-1] - file["path/events/t"][0])
    assert fedora_qa("export", path, out, "--to", "rerun").code == 0
    pictures = list(rows_of(out, rerun_recording.EVENTS, "EncodedImage:blob"))
    assert len(pictures) == -(-span_us // 20_000) + 1


def test_refusals(fedora_qa: Command, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A record of another file, a record for another form, and a missing package: one sentence, and no output."""
    record, other = tmp_path / "record.json", tmp_path / "other.h5"
    shutil.copyfile(source, other)
    fedora_qa("check", source, "--json", record, "--select", "integrity.layout")
    wrong = fedora_qa("export", other, tmp_path / "out", "--to", "rerun", "--record", record)
    assert (wrong.code, "Expected other.h5 in" in wrong.err) == (2, True)
    beside = fedora_qa("export", source, tmp_path / "out", "--to", "tum", "--record", record)
    assert (beside.code, "Expected --record with --to rerun" in beside.err) == (2, True)
    monkeypatch.delitem(sys.modules, "fedora_qa.exporting.rerun_recording")
    monkeypatch.setitem(sys.modules, "rerun", None)
    missing = fedora_qa("export", source, tmp_path / "out", "--to", "rerun")
    assert (missing.code, "pip install 'fedora-qa[rerun]'" in missing.err) == (2, True)
    assert not (tmp_path / "out").exists()
