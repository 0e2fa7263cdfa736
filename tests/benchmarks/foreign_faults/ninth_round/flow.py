"""Optical flow that calibrations, augmentations, masks and filters change."""

import cv2
import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA


def of_rows_with_another_focal_length(file: h5py.File, plan: Plan) -> None:
    """Flow is computed with a focal length of rows that is too large by so many percent."""
    attributes = file[CAMERA + "depth"].attrs
    declared = np.array(attributes["K"])
    K = declared.copy()
    K[1, 1] *= 1 + plan.size / 100
    attributes["K"] = K
    fields = recomputed(file)
    attributes["K"] = declared
    for key, values in fields.items():
        replace_values(file, key, values)


def of_the_published_pose(file: h5py.File, plan: Plan) -> None:
    """Flow is computed from the pose of the file, which has its declared noise."""
    for key, values in recomputed(file).items():
        replace_values(file, key, values)


def without_what_is_slow(file: h5py.File, plan: Plan) -> None:
    """The so many percent of vectors that are shortest have no value."""
    for key in KEYS:
        values = file[key][...]
        length_px = np.linalg.norm(values, axis=-1)
        values[length_px < np.nanquantile(length_px, plan.size / 100)] = np.nan
        replace_values(file, key, values)


def with_validity(file: h5py.File, plan: Plan) -> None:
    """A third channel is 1 where a vector has a value."""
    for key in KEYS:
        values = file[key][...]
        is_valid = np.isfinite(values).all(axis=-1, keepdims=True).astype(values.dtype)
        replace_values(file, key, np.concatenate([values, is_valid], axis=-1))


def flipped_at_random(file: h5py.File, plan: Plan) -> None:
    """So many percent of fields, and at least one, are mirrored left to right, with their vectors."""
    for key in KEYS:
        values = file[key][...]
        is_flipped = plan.random.random(len(values)) < plan.size / 100
        is_flipped[plan.random.integers(len(values))] = True
        values[is_flipped] = values[is_flipped, :, ::-1] * np.array([-1, 1], dtype=values.dtype)
        replace_values(file, key, values)


def upwards_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows v points upwards."""
    for key in KEYS:
        values = file[key][...]
        values[plan.rows(len(values)), ..., 1] *= -1
        replace_values(file, key, values)


def smoothed_for_a_while(file: h5py.File, plan: Plan) -> None:
    """In the plan's rows vectors are means with the weights of a Gaussian, of so many px, over those with a value."""
    for key in KEYS:
        values = file[key][...]
        rows = plan.rows(len(values))
        for number in range(rows.start, rows.stop):
            is_valid = np.isfinite(values[number]).all(axis=-1)
            weights = cv2.GaussianBlur(is_valid.astype(np.float64), (0, 0), plan.size)
            sums = cv2.GaussianBlur(np.where(is_valid[..., None], values[number], 0.0), (0, 0), plan.size)
            values[number][is_valid] = (sums[is_valid] / weights[is_valid, None]).astype(values.dtype)
        replace_values(file, key, values)
