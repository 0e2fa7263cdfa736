"""Events against flow: sign, axes, unit and gross gain are found; time offsets and slow scenes are not judged."""

from collections.abc import Callable
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.checks.flow_events.sharpness import mean_square_expansion
from fedora_qa.conventions import R_BODY_OPTICAL
from tests.checks.event_file import DURATION_MS, FRAME_SHAPE, LOG_WORLD, SHAPE, log_file
from tests.estimators.event_world import MS, Stream, camera_matrix
from tests.support.checked import diagnoses_of, measured_record, rules, run_check

CHECK = "flow_events.sharpness"
PERIOD_US = 40_000
SCALE = FRAME_SHAPE[1] / 56


LENS = (-0.37, 0.16, 4e-4, -3e-4)
TURN_RAD = np.array([0.01, -0.02, 0.015])
"""Of the event camera's rays to those of the view of the flow, a rotation vector."""


def drifting_dots() -> Stream:
    """Dots that drift with the world's velocity, each of which fires at random times in the pixel where it then is."""
    times_ns, at, p = dots_in_view()
    x, y = (np.rint(at[:, i]).astype(int) % SHAPE[1 - i] for i in (0, 1))
    return Stream(x.astype(np.uint16), y.astype(np.uint16), times_ns, p)


def dots_through_a_lens() -> Stream:
    """The same dots, in the pixels of a camera with ``LENS`` that is turned by ``TURN_RAD`` against the flow's."""
    times_ns, at, p = dots_in_view()
    K = camera_matrix(SHAPE[1], SHAPE[0])
    turn, _ = cv2.Rodrigues(TURN_RAD)
    rays = np.column_stack([at % SHAPE[::-1], np.ones(len(at))]) @ np.linalg.inv(K).T @ turn
    pixels = np.rint(cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(LENS))[0].reshape(-1, 2))
    inside = np.all((pixels >= 0) & (pixels < SHAPE[::-1]), axis=1)
    x, y = pixels[inside].astype(np.uint16).T
    return Stream(x, y, times_ns[inside], p[inside])


def dots_in_view() -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.uint8]]:
    """Times, positions (n, 2) without a border, px, and polarities of the dots."""
    rng = np.random.default_rng(4)
    times_ns = np.sort(rng.integers(1, DURATION_MS * MS, 40_000))
    dot, starts = rng.integers(0, 30, times_ns.size), rng.uniform((0, 0), SHAPE[::-1], (30, 2))
    at = starts[dot] + np.multiply.outer(times_ns * 1e-9, LOG_WORLD.velocity_px_s)
    return times_ns, at, rng.integers(0, 2, times_ns.size).astype(np.uint8)


def write(
    path: Path, change: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda flow: flow,
    events: Stream | None = None,
) -> Path:  # fmt: skip
    """Events of drifting dots, and the flow of their drift at 25 Hz on the depth grid, altered."""
    log_file().altered(events=events or drifting_dots()).write(path)
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


def write_distorted(path: Path, percent: float = 0.0, lens: tuple[float, ...] = LENS) -> Path:
    """Dots that are seen through a lens, and flow that is too large, in the view of a pinhole; the lens is declared."""
    write(path, lambda flow: flow * (1 + percent / 100), dots_through_a_lens())
    turn, _ = cv2.Rodrigues(TURN_RAD)
    with h5py.File(path, "r+") as file:
        camera = file["metadata/cameras/events"].attrs
        camera["distortion_model"], camera["distortion"] = "radtan", lens
        T_body_camera = camera["T_body_camera"].copy()
        T_body_camera[:3, :3] = T_body_camera[:3, :3] @ turn
        camera["T_body_camera"] = T_body_camera
    return path


def test_events_through_a_lens_are_sharp_under_the_flow_of_a_pinhole(tmp_path: Path) -> None:
    """As those without: to a few percent, with a bound that grows with the pixels of the margin, which are wider."""
    results = [
        run_check(write(tmp_path / "pinhole.h5"), CHECK),
        run_check(write_distorted(tmp_path / "lens.h5"), CHECK),
    ]
    assert [result.outcome for result in results] == ["passed", "passed"]
    straight, distorted = (next(m for m in result.measurements if m.name == "gain_25hz") for result in results)
    assert distorted.value == pytest.approx(0.0, abs=2.0)
    assert straight.limit is not None
    assert distorted.limit is not None
    assert straight.limit < distorted.limit < 1.5 * straight.limit
    assert measured_record(tmp_path / "lens.h5", "flow_events").inferred["events.share_in_view_of_flow"] == 1.0


@pytest.mark.parametrize("percent", [-20.0, 25.0])
def test_gain_is_measured_through_a_lens(percent: float, tmp_path: Path) -> None:
    """A gross gain is found, and its size to a tenth."""
    path = write_distorted(tmp_path / "gain.h5", percent)
    assert "gain" in rules(run_check(path, CHECK))
    (diagnosis,) = diagnoses_of(path, "flow_events")
    assert (diagnosis.cause, diagnosis.stream) == ("flow_gain", "flow")
    assert diagnosis.magnitude == pytest.approx(percent, abs=10.0)


def test_a_lens_whose_pixels_no_view_holds_is_not_judged(tmp_path: Path) -> None:
    """Where a lens is declared that images no ray of the pixels, no event meets a flow; nothing crashes."""
    path = write_distorted(tmp_path / "blind.h5", lens=(1e6, 0.0, 0.0, 0.0))
    assert run_check(path, CHECK).outcome == "not_observable"


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


@pytest.mark.parametrize("stride", [1, 3])
def test_approach_is_read_from_the_flow(stride: int) -> None:
    """A wall that comes nearer by a twentieth expands by that, whatever an outline or a hole adds."""
    rows, columns = np.mgrid[:80, :100]
    flow_px = 0.05 * np.stack([columns - 40.0, rows - 30.0], axis=-1) + (3.0, -1.0)
    flow_px[:, 60:] += 20.0
    flow_px[10:20, 10:20] = np.nan
    assert mean_square_expansion(flow_px, stride) == pytest.approx(0.05**2, rel=1e-6)
    assert mean_square_expansion(np.full((8, 9, 2), np.nan), 1) == 0.0
