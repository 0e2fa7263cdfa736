"""Colours against events where frames are noisy."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.support.checked import run_check
from tests.support.sequences import CleanSequence


@pytest.mark.parametrize("scene", ["racetrack", "park-day"])
@pytest.mark.parametrize("noise_dn", [2.0, 4.0])
def test_read_noise_of_single_channels_is_no_wrong_order(
    noise_dn: float, scene: str, clean_sequence: CleanSequence, tmp_path: Path
) -> None:
    """Noise makes fitted weights equal, or worse where channels change together; the bound covers that."""
    path, rng = tmp_path / "noisy.h5", np.random.default_rng(0)
    path.write_bytes(clean_sequence(scene).read_bytes())
    with h5py.File(path, "a") as file:
        frames = file["path/rgb"]
        noisy = frames[()] + rng.normal(0.0, noise_dn, frames.shape)
        frames[...] = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    result = run_check(path, "images.channels")
    assert not result.findings
