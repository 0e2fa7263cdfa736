"""Faults of the colour frames."""

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault
from fedora_generator.faults.rows import edit_values


def channel_order(file: h5py.File, fault: Fault) -> None:
    """Write blue first."""
    edit_values(file, fault, lambda frames: frames[..., ::-1])


def exposure_or_gamma(file: h5py.File, fault: Fault) -> None:
    """Make the values too large by the magnitude, as a longer exposure would, clipped at 255."""
    gain = 1 + fault.magnitude_in("percent") / 100
    edit_values(file, fault, lambda frames: np.rint(np.clip(frames * gain, 0, 255)).astype(np.uint8))
