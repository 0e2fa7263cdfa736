"""Every check fails on a fault planted for it: right stream, right cause, right size, right place."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.checks import CHECKS
from fedora_qa.engine.run import CheckOptions, check_file
from tests.support.sequences import make_sequence


@dataclass(frozen=True)
class Planted:
    """A fault, the scene it is planted in, and how near its diagnosed size must be (None: it has no size)."""

    cause: str
    stream: str
    magnitude: float | None = None
    unit: str | None = None
    scene: str = "park-day"
    within: float | None = None
    start_s: float | None = None


PLANTED = {
    "integrity.layout": Planted("missing_stream", "imu"),
    "integrity.readable": Planted("corrupt_chunk", "depth", 1, within=0.0),
    "integrity.finite": Planted("nan_in_stream", "imu", 3, within=0.0),
    "metadata.complete": Planted("missing_stream", "metadata"),
    "metadata.units": Planted("flow_unit", "metadata"),
    "metadata.cameras": Planted("wrong_shape", "metadata"),
    "clocks.order": Planted("unsorted", "pose", 1, within=0.0),
    "clocks.unit": Planted("time_unit", "imu", within=0.0),
    "clocks.rate": Planted("clock_rate", "imu", 500, within=0.05),
    "clocks.gaps": Planted("dropped_samples", "imu", 3, within=0.0, start_s=0.4),
    "clocks.span": Planted("truncated", "depth", 20, within=0.1),
    "clocks.resolution": Planted("quantised_time", "events", 1, "ms", within=0.0),
    "index_maps.rgb": Planted("index_off_by_one", "rgb_to_event", 1, within=0.0),
    "index_maps.depth": Planted("index_off_by_one", "depth_to_event", -2, within=0.0),
    "event_stream.bounds": Planted("axes_swapped", "events"),
    "event_stream.duplicates": Planted("duplicated_samples", "events", 5, "ms"),
    "event_stream.gaps": Planted("dropped_samples", "events", 5, "ms", scene="fast-turn", start_s=0.5),
    "event_stream.rates": Planted("hot_pixels", "events", 3, within=0.0),
    "event_response.orientation": Planted("polarity_inverted", "events"),
    "event_response.model": Planted("event_model_misdeclared", "events"),
    "event_response.threshold": Planted("threshold_misdeclared", "events", 20, within=0.15),
    "event_response.timing": Planted("time_offset", "events", 5, "ms", within=0.15),
    "event_response.conservation": Planted("mirrored", "events"),
    "flow_photometric.residual": Planted("flow_gain", "flow", 10, within=0.05),
    "flow_geometry.endpoint": Planted("flow_gain", "flow/25hz", -10, within=0.05),
    "flow_geometry.validity": Planted("invalid_encoding", "flow"),
    "pose.orientation": Planted("quaternion_not_unit", "pose", 0.01, within=0.05),
    "pose.continuity": Planted("teleport", "pose", 0.1, within=0.05, start_s=0.5),
    "pose.noise": Planted("noise_misdeclared", "pose", 100, scene="park-noisy", within=0.2),
    "imu.rotation": Planted("gyro_bias", "imu", 0.05, within=0.05),
    "imu.translation": Planted("gravity_missing", "imu"),
    "imu.timing": Planted("time_offset", "imu", 5, "ms", within=0.05),
    "imu.noise": Planted("noise_misdeclared", "imu", 100, scene="park-noisy", within=0.2),
}
"""A fault for each check that its failing must name. Sizes are well above detection limits; the power study has those."""

WITHOUT_A_FAULT = {
    "metadata.profile": "its rules are those of a profile that the generator does not promise; see test_metadata",
}


@pytest.fixture(scope="session")
def scenes(tmp_path_factory: pytest.TempPathFactory, park_day: Path) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("scenes")
    names = {planted.scene for planted in PLANTED.values()} - {"park-day"}
    return {"park-day": park_day} | {name: make_sequence(folder / f"{name}.h5", name) for name in sorted(names)}


@pytest.mark.parametrize("check", PLANTED)
def test_check_names_its_planted_fault(check: str, scenes: dict[str, Path], tmp_path: Path) -> None:
    """The check fails, and the first diagnosis is the planted cause in its stream, with its size."""
    planted, path = PLANTED[check], tmp_path / "faulty.h5"
    plant_fault(scenes[planted.scene], path, planted.cause, planted.stream, planted.magnitude, planted.unit,
                start_s=planted.start_s)  # fmt: skip
    record = check_file(path, CheckOptions()).record
    failed = {result.check: result for result in record.results if result.outcome == "failed"}
    assert record.verdict == "findings"
    assert check in failed
    first = record.diagnoses[0]
    assert (first.cause, first.stream) == (planted.cause, planted.stream)
    assert {finding.id for finding in failed[check].findings} & set(first.explains)
    if planted.within is not None and planted.magnitude is not None:
        assert first.magnitude == pytest.approx(planted.magnitude, rel=planted.within, abs=1e-12)
    if planted.start_s is not None:
        assert first.where.start_us == pytest.approx(planted.start_s * 1e6, abs=25_000)


def test_every_check_has_a_planted_fault() -> None:
    """No check is without a proof that it can fail."""
    assert {check.name for check in CHECKS} == set(PLANTED) | set(WITHOUT_A_FAULT)
