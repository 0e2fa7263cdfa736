"""Sequences of other rates than the paper's: clean where they are correct, and a fault is named with its own rate."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

from fedora_generator.faults import plant_fault
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.rates import RateOptions
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import FileRecord
from tests.support.checked import checks_that_read
from tests.support.sequences import small_scene

DECIMAL = RateOptions(frames_hz=100.0, flow_hz=(20.0, 12.5), pose_hz=250.0)
FAST = RateOptions(frames_hz=60.0, depth_hz=300.0, flow_hz=(5.0, 30.0, 100.0))
VIDEO = RateOptions(frames_hz=30.0, flow_hz=(10.0, 15.0, 30.0))
RATES = {"decimal": DECIMAL, "fast": FAST, "video": VIDEO}

DURATIONS_S = {"decimal": 0.6, "fast": 1.0, "video": 0.6}
"""As short as gives every check the outcome of a second: vignetting along flow of 30 Hz needs that second."""

Sequences = Callable[[str], Path]


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Sequences:
    """The park at each set of rates, clean, written once."""
    folder = tmp_path_factory.mktemp("rates")

    def sequence(name: str) -> Path:
        path = folder / f"{name}.h5"
        if not path.exists():
            scene = replace(small_scene("park-day", 180, 136), rates=RATES[name])
            if name == "video":
                scene = replace(scene, imu=replace(scene.imu, rate_hz=400.0))
            generate_sequence(scene, path, Request(duration_s=DURATIONS_S[name], quality="draft"))
        return path

    return sequence


def check(path: Path, *select: str) -> FileRecord:
    return check_file(path, CheckOptions(profile="release", evidence=None, select=select)).record


def named(record: FileRecord) -> list[str]:
    return [f"{diagnosis.stream}:{diagnosis.cause}" for diagnosis in record.diagnoses]


@pytest.mark.parametrize("name", list(RATES))
def test_any_rates_are_checked_and_clean(sequences: Sequences, name: str) -> None:
    """Every rate is measured by the checks of geometry, clocks and values, and has statistics under its own name."""
    record = check(sequences(name))
    assert record.verdict == "clean"
    assert not [result.check for result in record.results if result.outcome in ("failed", "crashed")]
    rates = [f"flow/{rate_hz:g}hz" for rate_hz in sorted(RATES[name].flow_hz)]
    assert [group for group in record.statistics if group.startswith("flow/")] == rates
    measured = {result.check: {m.name for m in result.measurements} for result in record.results}
    for rate in rates:
        assert f"{rate} endpoint_error" in measured["flow_geometry.endpoint"]
        assert f"{rate} intervals_wrong_length" in measured["flow_geometry.validity"]
        assert f"{rate}.rate_error" in measured["clocks.rate"]
        assert f"{rate}.infinite" in measured["integrity.finite"]
        assert f"path/{rate}.step" in measured["integrity.resolution"]


def test_colour_is_compared_along_the_flow_between_its_frames(sequences: Sequences) -> None:
    """Colour of 60 Hz has no frames at the ends of flow of 100 Hz: that of 30 Hz leads from frame to frame."""
    checks = ("images.order", "images.exposure", "images.vignetting")
    record = check_file(sequences("fast"), CheckOptions(select=checks, evidence=None)).record
    outcomes = {result.check: result.outcome for result in record.results}
    assert [outcomes[check] for check in checks] == ["passed"] * 3


@pytest.mark.parametrize(
    ("name", "stream", "cause", "magnitude"),
    [
        ("decimal", "flow/12.5hz", "flow_gain", 5.0),
        ("decimal", "flow/12.5hz", "flow_interval_shifted", 1.0),
        ("decimal", "flow/20hz", "dropped_samples", 2.0),
        # Undone in both rates it clears as much, and spoils the other by rules that this one breaks.
        ("decimal", "flow/20hz", "flow_sign", None),
        ("decimal", "flow/20hz", "nan_in_stream", 2.0),
        ("fast", "flow/5hz", "flow_rate_mixed", None),
        ("fast", "flow/30hz", "flow_gain", 10.0),
        ("video", "flow/15hz", "flow_gain", 5.0),
        ("video", "flow", "flow_sign", None),
    ],
)
def test_a_fault_is_named_with_its_rate(
    sequences: Sequences, tmp_path: Path, name: str, stream: str, cause: str, magnitude: float | None
) -> None:
    """One fault of one rate has one cause, in the stream of that rate, by all checks that read it."""
    faulty = tmp_path / "faulty.h5"
    plant_fault(sequences(name), faulty, cause, stream, magnitude)
    record = check(faulty, *checks_that_read(stream))
    assert record.verdict == "findings"
    assert named(record) == [f"{stream}:{cause}"]


def test_a_name_that_contradicts_its_intervals(sequences: Sequences, tmp_path: Path) -> None:
    """Flow of 20 Hz in the name of 40 Hz: its clock and its intervals are held against the name."""
    path = tmp_path / "renamed.h5"
    path.write_bytes(sequences("decimal").read_bytes())
    with h5py.File(path, "r+") as file:
        for ending in ("", "_ts"):
            file.move(f"path/flow/20hz{ending}", f"path/flow/40hz{ending}")
    record = check(path, *checks_that_read("flow"))
    findings = [finding for result in record.results for finding in result.findings]
    codes = {finding.code for finding in findings if finding.where.stream == "flow/40hz"}
    assert {"clocks.rate.error", "flow_geometry.validity.wrong_length"} <= codes
    (wrong,) = (f for f in findings if f.code == "flow_geometry.validity.wrong_length")
    assert "12 of 12 intervals of flow/40hz do not last 25 ms" in wrong.message
    assert {diagnosis.stream for diagnosis in record.diagnoses} == {"flow/40hz"}


def test_a_name_that_is_a_little_off(sequences: Sequences, tmp_path: Path) -> None:
    """Half a percent is no frame of an interval, and 5000 ppm of the clock."""
    path = tmp_path / "renamed.h5"
    path.write_bytes(sequences("decimal").read_bytes())
    with h5py.File(path, "r+") as file:
        for ending in ("", "_ts"):
            file.move(f"path/flow/20hz{ending}", f"path/flow/20.1hz{ending}")
    record = check_file(path, CheckOptions(select=("clocks",), evidence=None)).record
    (finding,) = (finding for result in record.results for finding in result.findings)
    assert (finding.code, finding.where.stream) == ("clocks.rate.error", "flow/20.1hz")
    assert "+5000 ppm off the nominal 49751.2 us" in finding.message
