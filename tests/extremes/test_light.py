"""Too little light, too much, and nothing to see: right answers or not observable, never a pass in the dark."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.faults import plant_fault
from tests.extremes.files import (
    alarms,
    checks_of,
    edited,
    generated,
    keep_events,
    lit,
    named,
    outcomes,
    park,
    passed,
    record_of,
)

DIM_MEAN_DN = 4.0
OF_FRAMES = [name for name in checks_of("rgb") if not name.startswith("index_maps")]
OF_TEXTURE = [name for name in OF_FRAMES if name != "images.vignetting"]
"""Checks of frames that need something to see; even light shows vignetting best."""


@pytest.fixture(scope="module")
def dim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A night of 4 DN, drawn so."""
    scene = lit(park("park-night"), ambient=0.0061, lamp_scale=0.12)
    path = generated(scene, tmp_path_factory.mktemp("light") / "dim.h5")
    with h5py.File(path) as file:
        assert np.mean(file["path/rgb"][:]) == pytest.approx(DIM_MEAN_DN, abs=0.5)
    return path


@pytest.fixture(scope="module")
def glare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A noon that clips six pixels of seven, drawn so."""
    return generated(lit(park(), ambient=3.0, sun_strength=6.0), tmp_path_factory.mktemp("light") / "glare.h5")


def test_four_dn_are_no_alarm(dim: Path) -> None:
    """Right: clean. Rounding is a tenth of the light, so exposure and transfer have nothing to say, and say so."""
    record = record_of(dim)
    assert not alarms(record)
    assert record.verdict == "clean"
    dark = [
        "images.exposure",
        "images.channels",
        "images.transfer",
        "event_response.threshold",
        "event_response.timing",
    ]
    assert not passed(record, dark)


GROSS = {
    "polarity": ("polarity_inverted", "events", None, ("event_response",)),
    "gain": ("flow_gain", "flow", 20.0, ("flow_geometry", "flow_rates")),
    "late IMU": ("time_offset", "imu", 1.0, ("imu",)),
}


@pytest.mark.parametrize(("cause", "stream", "magnitude", "subjects"), GROSS.values(), ids=GROSS)
def test_gross_faults_are_found_at_four_dn(
    cause: str, stream: str, magnitude: float | None, subjects: tuple[str, ...], dim: Path, tmp_path: Path
) -> None:
    """Right: inverted polarity still shows in 4 DN, and what frames have no part in shows as ever."""
    faulty = tmp_path / "faulty.h5"
    plant_fault(dim, faulty, cause, stream, magnitude, "ms" if cause == "time_offset" else None)
    assert named(record_of(faulty, *subjects))[0] == (stream, cause)


def test_glare_is_said(glare: Path) -> None:
    """Right: no alarm, but a warning that most pixels are clipped."""
    record = record_of(glare)
    assert not alarms(record)
    assert outcomes(record)["images.exposure"] == "warned"


def test_glare_hides_polarity_and_that_is_said(glare: Path, tmp_path: Path) -> None:
    """Right: with every moving pixel clipped nothing tells the polarity; no check of events by frames passes."""
    faulty = tmp_path / "inverted.h5"
    plant_fault(glare, faulty, "polarity_inverted", "events")
    record = record_of(faulty, "event_response")
    assert not passed(record, [name for name in checks_of("events") if name.startswith("event_response")])


def filled_with(value_dn: int) -> Callable[[h5py.File], None]:
    def fill(file: h5py.File) -> None:
        file["path/rgb"][...] = np.full(file["path/rgb"].shape, value_dn)

    return fill


@pytest.mark.parametrize("value_dn", [0, 255], ids=["black", "saturated"])
def test_frames_of_one_end_say_nothing(value_dn: int, half_second: Path, tmp_path: Path) -> None:
    """Right: black and saturated frames fit any events and any flow. Not one check of frames passes, and none fails."""
    record = record_of(edited(half_second, tmp_path / "blank.h5", filled_with(value_dn)))
    assert not alarms(record)
    assert not passed(record, OF_FRAMES)


def test_grey_frames_do_not_fit_events(half_second: Path, tmp_path: Path) -> None:
    """Right: events of half a second cannot come from frames that stay at 128 DN; the law of conservation breaks."""
    record = record_of(edited(half_second, tmp_path / "grey.h5", filled_with(128)))
    assert outcomes(record)["event_response.conservation"] == "failed"
    assert not passed(record, OF_TEXTURE)


def test_even_light_shows_vignetting(half_second: Path, tmp_path: Path) -> None:
    """Right: grey frames pass as they are, and fail with corners that are a fifth too dark."""
    grey, faulty = edited(half_second, tmp_path / "grey.h5", filled_with(128)), tmp_path / "faulty.h5"
    plant_fault(grey, faulty, "vignetting", "rgb", 20.0)
    assert passed(record_of(grey, "images.vignetting"), ["images.vignetting"])
    assert named(record_of(faulty, "images.vignetting"))[0] == ("rgb", "vignetting")


def test_no_texture_is_not_observable(half_second: Path, tmp_path: Path) -> None:
    """Right: a flight through fog, grey and without events, is clean of faults; nothing of frames or events passes."""

    def fog(file: h5py.File) -> None:
        filled_with(128)(file)
        keep_events(file, 0)

    record = record_of(edited(half_second, tmp_path / "fog.h5", fog))
    assert not alarms(record)
    assert not passed(record, [*OF_TEXTURE, *(name for name in checks_of("events") if not name.startswith("index"))])
    assert set(passed(record, checks_of("imu", "pose"))) >= {
        "imu.timing",
        "depth.consistency",
        "flow_geometry.endpoint",
    }
