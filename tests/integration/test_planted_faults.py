"""Every check fails on a fault planted for it: right stream, right cause, right size, right place."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.support.all_checks import CHECKS
from tests.support.checked import checks_that_read
from tests.support.sequences import CleanSequence


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
    acquitted: tuple[str, ...] = ()
    """Other streams that what fails would suspect as well, but for checks of theirs that pass."""
    edit: Callable[[h5py.File], None] | None = None
    """Plants what the generator cannot: a contradiction within the metadata."""


def label_flow_as_px_s(file: h5py.File) -> None:
    for rate in (10, 25, 50):
        file[f"path/flow/{rate}hz"].attrs["units"] = "px/s"


def stretch_camera_rotation(file: h5py.File) -> None:
    camera = file["metadata/cameras/events"].attrs
    camera["T_body_camera"] = camera["T_body_camera"] @ np.diag([1.1, 1.0, 1.0, 1.0])


def cut_depth_off(file: h5py.File) -> None:
    depth = file["path/depth"]
    farthest_mm = np.float32(1000 * file["metadata/depth_range"][1])
    for frame in range(len(depth)):
        depth[frame] = np.where(np.isnan(depth[frame]), farthest_mm, depth[frame])


def index_next_event(file: h5py.File) -> None:
    times_us = file["path/events/t"][:]
    file["metadata/ms_to_event"] = np.searchsorted(times_us, np.arange(int(times_us[-1]) // 1000) * 1000) + 1


def promise_the_paper(file: h5py.File) -> None:
    file.attrs["profile"] = "fedora-paper"


PLANTED = {
    "integrity.layout": Planted("missing_stream", "imu"),
    "integrity.readable": Planted("corrupt_chunk", "depth", 1, within=0.0),
    "integrity.finite": Planted("nan_in_stream", "imu", 3, within=0.0),
    "integrity.resolution": Planted("quantised_values", "depth", 2),
    "metadata.complete": Planted("missing_stream", "metadata"),
    "metadata.units": Planted("flow_unit", "flow", edit=label_flow_as_px_s),
    "metadata.cameras": Planted("frame_convention", "metadata", edit=stretch_camera_rotation),
    "metadata.profile": Planted("wrong_shape", "metadata", edit=promise_the_paper),
    "clocks.order": Planted("unsorted", "pose", 1, within=0.0),
    "clocks.unit": Planted("time_unit", "imu", within=0.0),
    "clocks.rate": Planted("clock_rate", "imu", 500, within=0.05),
    "clocks.gaps": Planted("dropped_samples", "imu", 3, within=0.0, start_s=0.4),
    "clocks.span": Planted("truncated", "imu", 20, within=0.1),
    "clocks.resolution": Planted("quantised_time", "events", 1, "ms", within=0.0),
    "index_maps.rgb": Planted("index_off_by_one", "rgb_to_event", 1, within=0.0),
    "index_maps.depth": Planted("index_off_by_one", "depth_to_event", -2, within=0.0),
    "index_maps.milliseconds": Planted("index_off_by_one", "ms_to_event", 1, within=0.0, edit=index_next_event),
    "event_stream.bounds": Planted("axes_swapped", "events"),
    "event_stream.duplicates": Planted("duplicated_samples", "events", 5, "ms"),
    "event_stream.gaps": Planted("dropped_samples", "events", 5, "ms", scene="fast-turn", start_s=0.5),
    "event_stream.rates": Planted("hot_pixels", "events", 3, within=0.0),
    "event_response.orientation": Planted("polarity_inverted", "events"),
    "event_response.model": Planted("event_model_misdeclared", "events"),
    "event_response.threshold": Planted("threshold_misdeclared", "events", 20, within=0.15),
    "event_response.timing": Planted("time_offset", "events", 5, "ms", within=0.15),
    "event_response.jitter": Planted("time_jitter", "events", 2, "ms", within=0.3),
    "event_response.alignment": Planted("spatial_offset", "events", 3, within=0.2),
    "event_response.frames": Planted("frozen_frames", "rgb", 3, scene="fast-turn", start_s=0.5),
    "event_response.conservation": Planted("mirrored", "events"),
    "event_response.interpolation": Planted("interpolated_frames", "events"),
    "alignment.depth": Planted("spatial_offset", "depth", 3, within=0.1),
    "alignment.events": Planted("spatial_offset", "rgb", -3, within=0.1),
    "flow_events.sharpness": Planted("flow_gain", "flow", -30, scene="fast-turn", within=0.05),
    "flow_photometric.residual": Planted("flow_gain", "flow", 10, within=0.05),
    "flow_geometry.endpoint": Planted("flow_gain", "flow/25hz", -10, within=0.05),
    "flow_geometry.validity": Planted("invalid_encoding", "flow"),
    "flow_rates.composition": Planted("flow_interval_shifted", "flow/10hz", 1, within=0.0),
    "depth.range": Planted("invalid_encoding", "depth", edit=cut_depth_off),
    "depth.consistency": Planted("swapped_frames", "depth", 1, start_s=0.5),
    "depth.scale": Planted("unit_mm_m", "depth", 0.001, within=0.01),
    "depth.projection": Planted("depth_ray_not_z", "depth"),
    "images.repeats": Planted("frozen_frames", "rgb", 2, within=0.0, start_s=0.5),
    "images.order": Planted("swapped_frames", "rgb", 1, within=0.0, start_s=0.5, acquitted=("flow",)),
    "images.exposure": Planted("exposure_or_gamma", "rgb", 10, within=0.05, start_s=0.5),
    "images.channels": Planted("channel_order", "rgb", scene="park-traffic"),
    "images.vignetting": Planted("vignetting", "rgb", 30, within=0.1),
    "images.transfer": Planted("exposure_or_gamma", "rgb", 1.5, "gamma", scene="racetrack"),
    "pose.orientation": Planted("quaternion_not_unit", "pose", 0.01, within=0.05),
    "pose.continuity": Planted("teleport", "pose", 0.1, within=0.05, start_s=0.3),
    "pose.noise": Planted("noise_misdeclared", "pose", 100, scene="park-noisy", within=0.2),
    "imu.rotation": Planted("gyro_bias", "imu", 0.05, within=0.05),
    "imu.translation": Planted("gravity_missing", "imu"),
    "imu.timing": Planted("time_offset", "imu", 5, "ms", within=0.05),
    "imu.noise": Planted("noise_misdeclared", "imu", 100, scene="park-noisy", within=0.2),
}
"""A fault for each check that its failing must name. Sizes are well above the limits of detection."""

PLANTED_IN_MESHES = {
    check: replace(PLANTED[check], scene="park-mesh-day")
    for check in (
        "event_response.orientation",
        "event_response.timing",
        "event_response.alignment",
        "alignment.depth",
        "alignment.events",
        "flow_photometric.residual",
        "flow_geometry.endpoint",
        "flow_rates.composition",
        "depth.consistency",
        "depth.scale",
        "images.repeats",
    )
}
"""Faults of what is drawn, in the world that OpenGL draws. Stamps, IMU and pose are the same in both."""

PLANTED_AS_WELL = {
    "metadata.cameras": Planted("rectification_misdeclared", "metadata"),
    "clocks.rate": Planted("clock_rate", "pose", 500, within=0.05),
    "event_response.timing": Planted("time_offset", "rgb", 5, "ms", within=0.15),
    "flow_geometry.endpoint": Planted("time_offset", "flow", 20, "ms", within=0.05),
    "flow_geometry.validity": Planted("time_offset", "depth", 5, "ms", within=0.05, acquitted=("pose",)),
    "event_response.conservation": Planted("truncated", "events", 20),
}
"""Faults that a check sees as well as those planted above: of the other stream, or of another kind."""


def plant(planted: Planted, clean: Path, target: Path) -> None:
    if planted.edit is None:
        plant_fault(
            clean, target, planted.cause, planted.stream, planted.magnitude, planted.unit, start_s=planted.start_s
        )
        return
    shutil.copy(clean, target)
    with h5py.File(target, "r+") as file:
        planted.edit(file)


@pytest.mark.parametrize(
    ("check", "planted"),
    [
        *(pytest.param(check, planted, id=check) for check, planted in PLANTED.items()),
        *(pytest.param(check, planted, id=f"{check} in meshes") for check, planted in PLANTED_IN_MESHES.items()),
        *(pytest.param(check, planted, id=f"{check} as well") for check, planted in PLANTED_AS_WELL.items()),
    ],
)
def test_check_names_its_planted_fault(
    check: str, planted: Planted, clean_sequence: CleanSequence, tmp_path: Path
) -> None:
    """The check fails, and the first diagnosis is the planted cause in its stream, with its size.

    Checks that do not read the stream are left out: what they measure of the clean file is tested for each scene.
    """
    path = tmp_path / "faulty.h5"
    plant(planted, clean_sequence(planted.scene), path)
    select = (check, *checks_that_read(planted.stream, *planted.acquitted))
    record = check_file(path, CheckOptions(select=select, evidence=None)).record
    failed = {result.check: result for result in record.results if result.outcome == "failed"}
    assert record.verdict == "findings"
    assert check in failed
    first = record.diagnoses[0]
    assert (first.cause, first.stream) == (planted.cause, planted.stream)
    explained = [finding for finding in failed[check].findings if finding.id in first.explains]
    assert explained
    if planted.within is not None and planted.magnitude is not None:
        assert first.magnitude == pytest.approx(planted.magnitude, rel=planted.within, abs=1e-12)
    if planted.start_s is not None:
        starts_us = [finding.where.start_us for finding in explained if finding.where.start_us is not None]
        assert pytest.approx(planted.start_s * 1e6, abs=25_000) in starts_us


def test_every_check_has_a_planted_fault() -> None:
    """No check is without a proof that it can fail."""
    assert {check.name for check in CHECKS} == set(PLANTED)
