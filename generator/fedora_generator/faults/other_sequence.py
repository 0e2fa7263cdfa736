"""A stream that belongs to another sequence."""

import h5py

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import blocks, datasets_in, streams_in


def other_sequence(file: h5py.File, fault: Fault) -> None:
    """Put the donor's stream, with the donor's stamps, in the place of the file's own."""
    if fault.donor is None or not fault.donor.is_file() or not h5py.is_hdf5(fault.donor):
        raise FaultError(f"Expected an HDF5 file to take {fault.stream} from, got {fault.donor}; use --donor")
    with h5py.File(fault.donor) as donor:
        for stream in streams_in(file, fault.stream):
            for key, dataset in datasets_in(file, stream).items():
                _replace_rows(dataset, donor, key)


def _replace_rows(dataset: h5py.Dataset, donor: h5py.File, key: str) -> None:
    if key not in donor or donor[key].shape[1:] != dataset.shape[1:]:
        got = donor[key].shape[1:] if key in donor else "none"
        raise FaultError(f"Expected {key} with rows of shape {dataset.shape[1:]} in {donor.filename}, got {got}")
    dataset.resize(len(donor[key]), axis=0)
    for block in blocks(dataset):
        dataset[block] = donor[key][block]
