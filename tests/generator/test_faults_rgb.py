"""Faults of the colour frames: by how much values change, and in which frames."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_generator.faults import plant_fault
from fedora_generator.faults.fault import FaultError
from tests.generator.tiny_sequence import write_tiny_sequence

Frames = NDArray[np.uint8]


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clean") / "clean.h5"
    write_tiny_sequence(path, origin_us=5_000_000)
    return path


def frames(path: Path) -> Frames:
    with h5py.File(path) as file:
        return np.asarray(file["path/rgb"][...])


def planted(clean: Path, target: Path, magnitude: float, unit: str, **when: float) -> Frames:
    plant_fault(clean, target, "exposure_or_gamma", "rgb", magnitude, unit, **when)
    return frames(target)


@pytest.mark.parametrize("magnitude", [-100.0, -30.0, 3.0, 400.0])
def test_exposure_multiplies_and_clips(clean: Path, tmp_path: Path, magnitude: float) -> None:
    """Values grow by so many percent, rounded, and stay between 0 and 255; -100% is black."""
    due = np.clip(np.rint(frames(clean) * (1 + magnitude / 100)), 0, 255)
    np.testing.assert_array_equal(planted(clean, tmp_path / "faulty.h5", magnitude, "percent"), due)


def test_gamma_bends_between_black_and_white(clean: Path, tmp_path: Path) -> None:
    """A gamma of 2.2 makes codes that, taken to its power, are the values again; nothing new is declared."""
    bent = planted(clean, tmp_path / "faulty.h5", 2.2, "gamma")
    again = 255 * (bent / 255.0) ** 2.2
    np.testing.assert_allclose(again, frames(clean), atol=1.2)
    with h5py.File(clean) as before, h5py.File(tmp_path / "faulty.h5") as after:
        assert dict(before["path/rgb"].attrs) == dict(after["path/rgb"].attrs)


def test_one_frame_alone_can_be_overexposed(clean: Path, tmp_path: Path) -> None:
    """An interval of one frame time changes that frame and no other."""
    changed = planted(clean, tmp_path / "faulty.h5", 20, "percent", start_s=0.2, stop_s=0.21) != frames(clean)
    assert np.flatnonzero(changed.any(axis=(1, 2, 3))).tolist() == [10]


def test_channels_are_exchanged_in_an_interval(clean: Path, tmp_path: Path) -> None:
    """Blue first in the frames of the interval, and red first elsewhere."""
    plant_fault(clean, tmp_path / "faulty.h5", "channel_order", "rgb", start_s=0.3)
    before, after = frames(clean), frames(tmp_path / "faulty.h5")
    np.testing.assert_array_equal(after[:15], before[:15])
    np.testing.assert_array_equal(after[15:], before[15:, :, :, ::-1])


@pytest.mark.parametrize(("magnitude", "unit"), [(-2.0, "gamma"), (3.0, "ms")])
def test_what_is_no_curve_is_refused(clean: Path, tmp_path: Path, magnitude: float, unit: str) -> None:
    """A negative gamma, or a unit of something else, leaves no file behind."""
    with pytest.raises(FaultError, match="Expected"):
        planted(clean, tmp_path / "faulty.h5", magnitude, unit)
    assert list(tmp_path.iterdir()) == []


def test_vignetting_darkens_about_the_principal_point(clean: Path, tmp_path: Path) -> None:
    """1 - loss r^2 / r_corner^2 in linear light; the middle stays, and the farthest corner loses all of it."""
    plant_fault(clean, tmp_path / "faulty.h5", "vignetting", "rgb", 30.0)
    before, after = frames(clean), frames(tmp_path / "faulty.h5")
    with h5py.File(clean) as file:
        K = file["metadata/cameras/rgb"].attrs["K"]
    y, x = np.indices(before.shape[1:3])
    squares = (x - K[0, 2]) ** 2 + (y - K[1, 2]) ** 2
    due = before * (1 - 0.3 * squares / squares.max())[..., np.newaxis]
    np.testing.assert_allclose(after, due, atol=0.5 + 1e-9)


@pytest.mark.parametrize("transfer", ["srgb", "gamma2.2"])
def test_vignetting_is_of_linear_light(clean: Path, tmp_path: Path, transfer: str) -> None:
    """Codes of a display are decoded, darkened, and encoded again; without a loss they stay."""
    shutil.copy(clean, tmp_path / "declared.h5")
    with h5py.File(tmp_path / "declared.h5", "r+") as file:
        file["path/rgb"].attrs["transfer"] = transfer
        file["path/rgb"][...] = 200
    plant_fault(tmp_path / "declared.h5", tmp_path / "none.h5", "vignetting", "rgb", 1e-9)
    assert np.all(frames(tmp_path / "none.h5") == 200)
    plant_fault(tmp_path / "declared.h5", tmp_path / "faulty.h5", "vignetting", "rgb", 50.0)
    # (0.5 L)^(1/2.2) for a power; sRGB is within 1.5 codes of its own power of 2.2 here.
    assert frames(tmp_path / "faulty.h5").min() == pytest.approx(200 * 0.5 ** (1 / 2.2), abs=2)


def test_vignetting_of_all_light_is_refused(clean: Path, tmp_path: Path) -> None:
    """Nothing would be left in the corner."""
    with pytest.raises(FaultError, match="below 100%"):
        plant_fault(clean, tmp_path / "faulty.h5", "vignetting", "rgb", 100.0)
