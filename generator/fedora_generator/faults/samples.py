"""Faults of samples, for every stream: lost, repeated, exchanged, frozen, not a number, or of another sequence."""

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import (
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
        raise FaultError(f"Expected an HDF5 file to take {fault.stream} from, got {fault.donor}; use --donor")
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
