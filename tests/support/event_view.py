"""A sequence of the generator in two files: one holds images as the event camera of the other would see them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import h5py
import numpy as np

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.rates import RateOptions
from tests.support.sequences import small_scene
from tests.support.shared_files import SharedFiles

Array = np.ndarray[Any, Any]

_RATES = RateOptions(frames_hz=40.0, depth_hz=20.0, flow_hz=(20.0,))


@dataclass(frozen=True)
class TwoViews:
    """One flight through the park.

    Attributes
    ----------
    sequence
        Canonical file with events, and larger images.
    event_sized
        Canonical file with images, depth and flow in the view of the event camera of ``sequence``.
    """

    sequence: Path
    event_sized: Path


LensName = Literal["none", "radtan", "equidistant"]

LENSES: Final[Mapping[LensName, tuple[float, ...]]] = {
    "radtan": (-0.37, 0.16, 4e-4, -3e-4),
    "equidistant": (-0.03, 0.012, -0.008, 0.002),
}
"""As strong as those of real event cameras."""


def two_views(shared_files: SharedFiles, *, lens: LensName = "none") -> TwoViews:
    """Return a second of the park in both views, through a pinhole or one of ``LENSES``, written once a run."""
    name = "park-40hz" if lens == "none" else f"park-40hz-{lens}"

    def write(path: Path, width: int, height: int) -> None:
        scene = replace(small_scene("park-day", width, height), rates=_RATES)
        if lens != "none":
            camera = replace(scene.camera, distortion_model=lens, distortion=LENSES[lens])
            scene = replace(scene, camera=camera)
        generate_sequence(scene, path, Request(duration_s=1.0, quality="draft"))

    sequence = shared_files.file(f"{name}.h5", lambda path: write(path, 270, 200))
    with h5py.File(sequence) as file:
        camera = file["metadata/cameras/events"].attrs
        width, height = int(camera["width"]), int(camera["height"])
    event_sized = shared_files.file(f"{name}-event-sized.h5", lambda path: write(path, width, height))
    with h5py.File(sequence) as file, h5py.File(event_sized) as other:
        for name in ("K", "T_body_camera"):
            expected = file["metadata/cameras/events"].attrs[name]
            np.testing.assert_allclose(other["metadata/cameras/rgb"].attrs[name], expected)
    return TwoViews(sequence, event_sized)


def camera_poses(file: h5py.File, times_us: Array) -> Array:
    """Return the poses T_world_camera (n, 4, 4) of the depth camera at instants that poses are stored for."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    rows = np.searchsorted(file["path/pose/ts"][:], times_us)
    np.testing.assert_array_equal(file["path/pose/ts"][:][rows], times_us)
    T_world_body = np.tile(np.eye(4), (len(rows), 1, 1))
    T_world_body[:, :3, :3] = Rotation.from_quat(file["path/pose/orientation"][:][rows]).as_matrix()
    T_world_body[:, :3, 3] = file["path/pose/position"][:][rows]
    return np.asarray(T_world_body @ file["metadata/cameras/depth"].attrs["T_body_camera"])
