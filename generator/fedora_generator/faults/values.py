"""Faults of how values are stored."""

from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults.fault import Fault
from fedora_generator.faults.rows import edit, streams_in, values_in, window_of


def quantised_values(file: h5py.File, fault: Fault) -> None:
    """Round every dataset of a stream to steps of so many percent of its largest absolute value."""
    share = abs(fault.magnitude_in("percent")) / 100
    for stream in streams_in(file, fault.stream):
        for dataset in values_in(file, stream):
            largest = max((float(np.nanmax(np.abs(block), initial=0.0)) for block in dataset), default=0.0)
            step = share * largest or 1.0

            def rounded(rows: NDArray[Any], step: float = step) -> NDArray[Any]:
                return (step * np.rint(rows / step)).astype(rows.dtype)

            edit(dataset, window_of(file, stream, fault), rounded)
