"""Flow that networks, disks, jobs and scripts compute or store in another way."""

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS
from tests.benchmarks.foreign_faults.images import sampled
from tests.benchmarks.foreign_faults.kind import Plan


def of_the_fastest_rate(file: h5py.File, plan: Plan) -> None:
    """Fields of slower rates are those of 50 Hz which begin with them, times how much longer their interval is."""
    fine, fine_us = file["path/flow/50hz"][...], file["path/flow/50hz_ts"][...]
    for rate in ("10hz", "25hz"):
        intervals_us = file[f"path/flow/{rate}_ts"][...]
        rows = np.minimum(np.searchsorted(fine_us[:, 0], intervals_us[:, 0]), len(fine) - 1)
        longer = np.diff(intervals_us, axis=1)[:, 0] / np.diff(fine_us[rows], axis=1)[:, 0]
        replace_values(file, f"path/flow/{rate}", (fine[rows] * longer[:, None, None, None]).astype(fine.dtype))


def _filled(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a field (H, W, 2) in which a pixel without a vector has that of the nearest one with one."""
    invalid = ~np.isfinite(field).all(axis=-1)
    if invalid.all():
        return np.zeros_like(field)
    rows, columns = distance_transform_edt(invalid, return_distances=False, return_indices=True)
    return np.asarray(field[rows, columns], dtype=np.float32)


def holes_filled(file: h5py.File, plan: Plan) -> None:
    """What has no vector has that of the nearest pixel with one."""
    for key in KEYS:
        replace_values(file, key, np.stack([_filled(field) for field in file[key][...]]))


def of_a_coarse_grid(file: h5py.File, plan: Plan) -> None:
    """Vectors are known at the middle of blocks of so many px, and read bilinearly between these."""
    for key in KEYS:
        fields = file[key][...]
        height, width = fields.shape[1:3]
        middles = [(np.arange(extent // plan.size) + 0.5) * plan.size - 0.5 for extent in (width, height)]
        back = [(np.arange(extent) + 0.5) / plan.size - 0.5 for extent in (width, height)]
        for row, field in enumerate(fields):
            coarse = sampled(_filled(field).astype(np.float64), *np.meshgrid(*middles))
            fields[row] = np.where(np.isfinite(field), sampled(coarse, *np.meshgrid(*back)), np.nan)
        replace_values(file, key, fields)


def _rows_from_second(plan: Plan, count: int) -> slice:
    """Return the plan's rows but the first of all; at least one."""
    rows = plan.rows(count)
    begin = max(1, rows.start)
    return slice(begin, max(rows.stop, begin + 1))


def of_the_interval_before_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Fields of the plan's rows are those of the interval before their own."""
    for key in KEYS:
        fields = file[key][...]
        rows = _rows_from_second(plan, len(fields))
        fields[rows] = fields[rows.start - 1 : rows.stop - 1].copy()
        replace_values(file, key, fields)


def per_second_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Vectors of the plan's rows are divided by the length of their interval, s."""
    for key in KEYS:
        fields = file[key][...]
        rows = plan.rows(len(fields))
        seconds = np.diff(file[f"{key}_ts"][...][rows], axis=1)[:, 0] / 1e6
        fields[rows] /= seconds[:, None, None, None].astype(fields.dtype)
        replace_values(file, key, fields)


def zero_for_a_while(file: h5py.File, plan: Plan) -> None:
    """All of the plan's rows is zero, also what has no vector."""
    for key in KEYS:
        fields = file[key][...]
        fields[plan.rows(len(fields))] = 0
        replace_values(file, key, fields)


def bits_flip_on_a_disk(file: h5py.File, plan: Plan) -> None:
    """One to three bits of the stored bytes of each of the plan's rows are inverted."""
    for key in KEYS:
        dataset = file[key].id
        rows = plan.rows(len(file[key]))
        for number in range(rows.start, rows.stop):
            mask, stored = dataset.read_direct_chunk((number, 0, 0, 0))
            damaged = bytearray(stored)
            # In the second half: a header that is damaged hides how.
            for place in plan.random.integers(len(damaged) // 2, len(damaged), int(plan.random.integers(1, 4))):
                damaged[place] ^= 1 << int(plan.random.integers(8))
            dataset.write_direct_chunk((number, 0, 0, 0), bytes(damaged), filter_mask=mask)
