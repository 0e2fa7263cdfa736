"""Events against flow: sign, axes, unit and gross gain are found; time offsets and slow scenes are not judged."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.conventions import R_BODY_OPTICAL
from tests.checks.event_file import DURATION_MS, FRAME_SHAPE, LOG_WORLD, SHAPE, log_file
from tests.estimators.event_world import MS, Stream, camera_matrix
from tests.support.checked import diagnoses_of, rules, run_check

CHECK = "flow_events.sharpness"
PERIOD_US = 40_000
SCALE = FRAME_SHAPE[1] / 56


def drifting_dots() -> Stream:
    """Dots that drift with the world's velocity, each of which fires at random times in the pixel where it then is."""
    rng = np.random.default_rng(4)
    times_ns = np.sort(rng.integers(1, DURATION_MS * MS, 40_000))
    dot, starts = rng.integers(0, 30, times_ns.size), rng.uniform((0, 0), SHAPE[::-1], (30, 2))
    at = starts[dot] + np.multiply.outer(times_ns * 1e-9, LOG_WORLD.velocity_px_s)
    x, y = (np.rint(at[:, i]).astype(int) % SHAPE[1 - i] for i in (0, 1))
    return Stream(x.astype(np.uint16), y.astype(np.uint16), times_ns, rng.integers(0, 2, x.size).astype(np.uint8))


def write(path: Path, change: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda flow: flow) -> Path:
    """Events of drifting dots, and the flow of their drift at 25 Hz on the depth grid, altered."""
    log_file().altered(events=drifting_dots()).write(path)
    starts = np.arange(0, 1000 * DURATION_MS - PERIOD_US + 1, PERIOD_US)
    flow_px = SCALE * np.array(LOG_WORLD.velocity_px_s) * PERIOD_US * 1e-6
    fields = np.broadcast_to(change(flow_px), (len(starts), *FRAME_SHAPE, 2))
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3] = R_BODY_OPTICAL
    with h5py.File(path, "r+") as file:
        file.create_dataset("path/flow/25hz", data=fields.astype(np.float32), chunks=(1, *FRAME_SHAPE, 2))
        file["path/flow/25hz_ts"] = np.column_stack([starts, starts + PERIOD_US])
        file.create_group("metadata/cameras/depth").attrs.update({
            "width": FRAME_SHAPE[1], "height": FRAME_SHAPE[0], "K": camera_matrix(FRAME_SHAPE[1], FRAME_SHAPE[0]),
            "T_body_camera": T_body_camera, "camera_model": "pinhole",
        })  # fmt: skip
    return path


def test_clean_file_passes(tmp_path: Path) -> None:
    """Under the true flow the events are sharpest, to a few percent."""
    result = run_check(write(tmp_path / "clean.h5"), CHECK)
    assert result.outcome == "passed"
    (gain,) = (m for m in result.measurements if m.name == "gain_25hz")
    assert gain.value == pytest.approx(0.0, abs=2.0)
    assert gain.limit is not None
    assert gain.limit < 15.0
    # One percent of the drift in an interval, in px of the event camera.
    assert gain.effect_px == pytest.approx(0.01 * PERIOD_US * 1e-6 * np.hypot(*LOG_WORLD.velocity_px_s), rel=0.05)


@pytest.mark.parametrize(
    ("cause", "change"),
    [
        ("flow_sign", lambda flow: -flow),
        ("axes_swapped", lambda flow: flow[::-1]),
        ("flow_unit", lambda flow: flow / (PERIOD_US * 1e-6)),
        ("flow_unit", lambda flow: flow * PERIOD_US * 1e-6),
    ],
    ids=["sign", "axes", "px/s", "px s"],
)
def test_gross_fault_is_named(
    cause: str, change: Callable[[NDArray[np.float64]], NDArray[np.float64]], tmp_path: Path
) -> None:
    """Another flow makes the events sharper, and says what the stored one is."""
    path = write(tmp_path / "faulty.h5", change)
    assert "other" in rules(run_check(path, CHECK))
    (diagnosis,) = diagnoses_of(path, "flow_events")
    assert (diagnosis.cause, diagnosis.stream) == (cause, "flow")


@pytest.mark.parametrize("percent", [-40.0, -20.0, 25.0, 50.0])
def test_gain_is_measured(percent: float, tmp_path: Path) -> None:
    """A gross gain is found, and its size to a tenth."""
    path = write(tmp_path / "gain.h5", lambda flow: flow * (1 + percent / 100))
    assert "gain" in rules(run_check(path, CHECK))
    (diagnosis,) = diagnoses_of(path, "flow_events")
    assert (diagnosis.cause, diagnosis.stream) == ("flow_gain", "flow")
    assert diagnosis.magnitude == pytest.approx(percent, abs=10.0)


def test_time_is_never_blamed(tmp_path: Path) -> None:
    """Events that are 20 ms late are as sharp as before."""
    path = write(tmp_path / "late.h5")
    with h5py.File(path, "r+") as file:
        file["path/events/t"][:] = file["path/events/t"][:] + 20_000  # us
    assert run_check(path, CHECK).outcome == "passed"


def test_slow_scenes_are_not_judged(tmp_path: Path) -> None:
    """Where nothing moves by a pixel under any candidate, nothing can be told."""
    path = write(tmp_path / "slow.h5", lambda flow: 0.0 * flow)
    assert run_check(path, CHECK).outcome == "not_observable"


def test_empty_flow_and_other_cameras_are_said(tmp_path: Path) -> None:
    """Without values of flow no event is carried, and that is said; a fisheye is not applicable."""
    path = write(tmp_path / "file.h5", lambda flow: np.nan * flow)
    assert run_check(path, CHECK).outcome == "not_observable"
    with h5py.File(path, "r+") as file:
        file["metadata/cameras/depth"].attrs["camera_model"] = "fisheye"
    assert run_check(path, CHECK).outcome == "not_applicable"


def test_focal_lengths_of_the_opposite_sign_are_left_to_the_metadata(tmp_path: Path) -> None:
    """The time over which events are compared would be the root of a negative number."""
    path = write(tmp_path / "negative.h5")
    with h5py.File(path, "r+") as file:
        camera = file["metadata/cameras/events"]
        camera.attrs["K"] = camera.attrs["K"] * [[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0]]
    result = run_check(path, CHECK)
    assert result.outcome == "not_applicable"
    assert "is not positive" in result.reason
