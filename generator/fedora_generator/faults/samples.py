"""Faults that every stream can have: of its samples, and of its clock."""

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import (
    Array,
    affected_rows,
    blocks,
    datasets_in,
    delete_rows,
    edit,
    insert_rows,
    require_before_stop,
    rows_before,
    streams_in,
    timestamps_in,
    values_in,
    window_of,
)


def dropped_samples(file: h5py.File, fault: Fault) -> None:
    """Remove consecutive samples: a number of them, or those of a duration."""
    for stream in streams_in(file, fault.stream):
        delete_rows(file, stream, _affected(file, stream, fault))


def duplicated_samples(file: h5py.File, fault: Fault) -> None:
    """Write consecutive samples twice, each copy directly after its sample, so that timestamps stay sorted."""
    for stream in streams_in(file, fault.stream):
        rows = _affected(file, stream, fault)
        for dataset in datasets_in(file, stream).values():
            insert_rows(dataset, np.arange(rows.start, rows.stop) + 1, dataset[rows])


def unsorted(file: h5py.File, fault: Fault) -> None:
    """Write the given number of consecutive samples in reverse."""
    count = max(2, fault.positive_count())
    for stream in streams_in(file, fault.stream):
        timestamps = timestamps_in(file, stream)
        rows = affected_rows(file, stream, fault, count)
        while rows.stop < len(timestamps) and np.all(timestamps[rows.stop - 1] == timestamps[rows.start]):
            rows = slice(rows.start, rows.stop + 1)  # samples of one timestamp have no order in time
        require_before_stop(file, stream, fault, rows.stop)
        for dataset in datasets_in(file, stream).values():
            dataset[rows] = dataset[rows][::-1]


def frozen_frames(file: h5py.File, fault: Fault) -> None:
    """Give a number of samples the value before them; their timestamps stay."""
    for stream in streams_in(file, fault.stream):
        rows = affected_rows(file, stream, fault, fault.positive_count())
        for dataset in values_in(file, stream):
            value = dataset[rows.start - 1]
            for block in blocks(dataset, rows):
                dataset[block] = np.broadcast_to(value, (block.stop - block.start, *value.shape))


def swapped_frames(file: h5py.File, fault: Fault) -> None:
    """Exchange the values of one sample with those the given number of samples later; timestamps stay."""
    distance = fault.positive_count()
    for stream in streams_in(file, fault.stream):
        first = affected_rows(file, stream, fault, distance + 1).start
        for dataset in values_in(file, stream):
            earlier, later = dataset[first], dataset[first + distance]
            dataset[first], dataset[first + distance] = later, earlier


def nan_in_stream(file: h5py.File, fault: Fault) -> None:
    """Overwrite every value of the given number of samples by NaN."""
    for stream in streams_in(file, fault.stream):
        rows = affected_rows(file, stream, fault, fault.positive_count())
        for dataset in values_in(file, stream):
            edit(dataset, rows, lambda values: np.full_like(values, np.nan))


def other_sequence(file: h5py.File, fault: Fault) -> None:
    """Put the donor's samples, with the donor's timestamps, in the place of the stream's own."""
    if fault.donor is None or not fault.donor.is_file() or not h5py.is_hdf5(fault.donor):
        raise FaultError(f"Expected an HDF5 file to take {fault.stream} from, got {fault.donor or 'none'}; use --donor")
    with h5py.File(fault.donor) as donor:
        for stream in streams_in(file, fault.stream):
            for key, dataset in datasets_in(file, stream).items():
                if key not in donor or donor[key].shape[1:] != dataset.shape[1:]:
                    shape, got = dataset.shape[1:], donor[key].shape[1:] if key in donor else "none"
                    raise FaultError(f"Expected {key} with rows of shape {shape} in {donor.filename}, got {got}")
                dataset.resize(len(donor[key]), axis=0)
                for block in blocks(dataset):
                    dataset[block] = donor[key][block]


def _affected(file: h5py.File, stream: str, fault: Fault) -> slice:
    if not fault.is_duration:
        return affected_rows(file, stream, fault, fault.positive_count())
    timestamps = timestamps_in(file, stream)
    first = affected_rows(file, stream, fault, 1).start
    stop_us = int(np.min(timestamps[first])) + round(fault.magnitude_in("us"))
    stop = int(rows_before(timestamps, np.array([stop_us], np.int64))[0])
    if not first < stop < len(timestamps):
        raise FaultError(
            f"Expected {fault.magnitude:g} {fault.unit} of {stream} within the sequence, got rows {first} to {stop} "
            f"of {len(timestamps)}; choose another magnitude or start"
        )
    require_before_stop(file, stream, fault, stop)
    return slice(first, stop)


US_PER_MS = 1_000


def time_offset(file: h5py.File, fault: Fault) -> None:
    """Make timestamps late by a constant, rounded to a microsecond."""
    offset_us = round(fault.magnitude_in("ms") * US_PER_MS)
    for stream in streams_in(file, fault.stream):
        edit(
            timestamps_in(file, stream), window_of(file, stream, fault), lambda timestamps_us: timestamps_us + offset_us
        )


def clock_rate(file: h5py.File, fault: Fault) -> None:
    """Make the clock fast from the first timestamp of the window on: ``t' = t + (t - t_first) * rate``."""
    rate = fault.magnitude_in("1")
    for stream in streams_in(file, fault.stream):
        timestamps, window = timestamps_in(file, stream), window_of(file, stream, fault)
        first_us = int(np.min(timestamps[window.start]))

        def stretch(timestamps_us: Array, first_us: int = first_us) -> Array:
            return timestamps_us + np.rint((timestamps_us - first_us) * rate).astype(np.int64)

        edit(timestamps, window, stretch)


def quantised_time(file: h5py.File, fault: Fault) -> None:
    """Round timestamps to the nearest multiple of the magnitude.

    Truncation, as in an integer division, would add an offset of half a grid.
    """
    grid_us = round(fault.magnitude_in("ms") * US_PER_MS)
    if grid_us < 2:
        raise FaultError(f"Expected a grid of at least 0.002 ms, got {fault.magnitude:g} {fault.unit}")
    for stream in streams_in(file, fault.stream):
        edit(
            timestamps_in(file, stream),
            window_of(file, stream, fault),
            lambda timestamps_us: (timestamps_us + grid_us // 2) // grid_us * grid_us,
        )


def time_unit(file: h5py.File, fault: Fault) -> None:
    """Multiply timestamps by the magnitude: 1000 writes nanoseconds, 0.001 milliseconds, rounded to whole ones."""
    factor = fault.magnitude_in("1")
    if factor <= 0 or factor == 1:
        raise FaultError(f"Expected a positive factor other than 1, such as 1000 or 0.001, got {factor:g}")

    def convert(timestamps_us: Array) -> Array:
        if factor.is_integer():
            return timestamps_us * int(factor)
        return np.rint(timestamps_us * factor).astype(np.int64)

    for stream in streams_in(file, fault.stream):
        edit(timestamps_in(file, stream), window_of(file, stream, fault), convert)
