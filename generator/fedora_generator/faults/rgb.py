"""Faults of the colour frames."""

from typing import Final

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import Array, edit_values

_WHITE: Final = 255.0


def channel_order(file: h5py.File, fault: Fault) -> None:
    """Write blue first."""
    edit_values(file, fault, lambda frames: frames[..., ::-1])


def exposure_or_gamma(file: h5py.File, fault: Fault) -> None:
    """Make the values too large by a magnitude in percent, as a longer exposure would, or apply a gamma.

    Values are clipped at 255; -100 percent makes frames black. With the unit ``gamma``, a magnitude of 2.2 writes what
    a display of that gamma needs, white and black staying where they are; nothing is declared.
    """
    # What each of the 256 codes becomes.
    codes = np.arange(256, dtype=np.float64)
    if fault.unit == "gamma":
        if not fault.magnitude > 0:
            raise FaultError(f"Expected a gamma above 0, got {fault.magnitude:g}")
        values: Array = _WHITE * (codes / _WHITE) ** (1 / fault.magnitude)
    else:
        values = codes * (1 + fault.magnitude_in("percent") / 100)
    curve: Array = np.rint(np.clip(values, 0, _WHITE)).astype(np.uint8)
    edit_values(file, fault, lambda frames: curve[frames])
