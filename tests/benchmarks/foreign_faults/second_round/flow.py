"""Flow that scripts compute, resize, cut or store in another way."""

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan, Plant


def _scaled(file: h5py.File, u: float, v: float) -> None:
    for key in KEYS:
        fields = file[key][...]
        replace_values(file, key, (fields * np.array([u, v])).astype(fields.dtype))


def at_nominal_rate(file: h5py.File, plan: Plan) -> None:
    """Intervals are counted with a period that is too long by so many ppm."""
    for key in KEYS:
        intervals_us = file[f"{key}_ts"][...]
        elapsed_us = intervals_us - intervals_us[0, 0]
        replace_values(file, f"{key}_ts", intervals_us + np.rint(elapsed_us * plan.size / 1e6).astype(np.int64))


def of_tilted_camera(file: h5py.File, plan: Plan) -> None:
    """Flow is computed for a camera that is turned by so many degrees about a random axis."""
    attributes = file["metadata/cameras/depth"].attrs
    mount = np.array(attributes["T_body_camera"])
    tilted = mount.copy()
    tilted[:3, :3] = mount[:3, :3] @ Rotation.from_rotvec(np.deg2rad(plan.size) * plan.direction()).as_matrix()
    attributes["T_body_camera"] = tilted
    fields = recomputed(file)
    attributes["T_body_camera"] = mount
    for key, values in fields.items():
        replace_values(file, key, values)


def from_depth_of_next_frame(file: h5py.File, plan: Plan) -> None:
    """Flow is computed from the depth frame after that of the interval's start."""
    depth = file["path/depth"][...]
    file["path/depth"][...] = np.concatenate([depth[1:], depth[-1:]])
    fields = recomputed(file)
    file["path/depth"][...] = depth
    for key, values in fields.items():
        replace_values(file, key, values)


def in_half_precision(file: h5py.File, plan: Plan) -> None:
    """Vectors went through 16-bit floating point, of which 11 bits are the mantissa."""
    for key in KEYS:
        replace_values(file, key, file[key][...].astype(np.float16).astype(np.float32))


def on_normalised_plane(file: h5py.File, plan: Plan) -> None:
    """Vectors are divided by the focal length."""
    K = np.asarray(file["metadata/cameras/depth"].attrs["K"])
    _scaled(file, 1 / K[0, 0], 1 / K[1, 1])


def rows_scaled(file: h5py.File, plan: Plan) -> None:
    """The vertical component is too long by so many percent."""
    _scaled(file, 1.0, 1 + plan.size / 100)


def in_clip_space(file: h5py.File, plan: Plan) -> None:
    """Width and height are 2, and v leads upwards."""
    height, width = file[KEYS[0]].shape[1:3]
    _scaled(file, 2 / width, -2 / height)


def mirrored_with_vectors(file: h5py.File, plan: Plan) -> None:
    """Fields are mirrored left to right, and so are their vectors."""
    for key in KEYS:
        fields = file[key][...][:, :, ::-1]
        replace_values(file, key, (fields * np.array([-1.0, 1.0])).astype(np.float32))


def shifted(file: h5py.File, plan: Plan) -> None:
    """Fields lie so many pixels to the right and down; the edge is repeated."""
    for key in KEYS:
        fields = file[key][...]
        for axis in (1, 2):
            source = np.clip(np.arange(fields.shape[axis]) - int(plan.size), 0, fields.shape[axis] - 1)
            fields = np.take(fields, source, axis=axis)
        replace_values(file, key, fields)


def of_another_sequence(file: h5py.File, plan: Plan) -> None:
    """Fields of the plan's rows are those of another sequence; intervals stay."""
    with h5py.File(plan.donor) as donor:
        for key in KEYS:
            fields = file[key][...]
            rows = plan.rows(len(fields))
            fields[rows] = donor[key][rows]
            replace_values(file, key, fields)


def backwards_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Vectors of the plan's rows have the other sign."""
    for key in KEYS:
        fields = file[key][...]
        fields[plan.rows(len(fields))] *= np.float32(-1)
        replace_values(file, key, fields)


def invalid_as_infinite(file: h5py.File, plan: Plan) -> None:
    """What has no flow is infinite."""
    for key in KEYS:
        replace_values(file, key, np.nan_to_num(file[key][...], nan=np.inf))


def planes_reshaped(file: h5py.File, plan: Plan) -> None:
    """Fields of shape (2, H, W) were reshaped, not transposed, to (H, W, 2)."""
    for key in KEYS:
        fields = file[key][...]
        replace_values(file, key, np.moveaxis(fields, -1, 1).reshape(fields.shape))


def unit_declared(unit: str) -> Plant:
    """The declaration names another unit."""

    def plant(file: h5py.File, plan: Plan) -> None:
        file["metadata/flow"].attrs["unit"] = unit

    return plant
