"""Streams other than events: RGB, depth and flow frame by frame, and the inertial streams."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import colour_camera
from fedora_generator.flight import Flight
from fedora_generator.flow import scene_flow_px
from fedora_generator.imu import Imu, PoseSensor
from fedora_generator.rates import intervals_us, pieces, rate_text, timestamps_us
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.scene import Scene
from fedora_generator.threads import in_threads
from fedora_generator.write import write_camera, write_dataset, write_depth_range, write_flow, write_imu, write_pose
from fedora_qa.conventions import MM_PER_M
from fedora_qa.layout.create import create_dataset
from fedora_qa.layout.direct_chunks import ChunkWriter

Floats = NDArray[np.float64]

DN_MAX: Final = 255

_LEVEL: Final = 3
"""Of compression. With 5, files of 1440x1080 are 1.3% smaller, and compression takes 1.8 times as long."""


@dataclass(frozen=True, slots=True)
class FlowRows:
    """Flow of one rate: intervals, fields and, in a world where bodies move, the masks of their pixels."""

    intervals_us: NDArray[np.int64]
    """(k, 2)"""
    flow: h5py.Dataset
    moving: h5py.Dataset | None


@dataclass(frozen=True, slots=True)
class FrameRenderer:
    """Renders the requested frames into their datasets, in any order, each once."""

    scene: Scene
    world: RenderedWorld
    flight: Flight
    rgb: h5py.Dataset | None
    depth: h5py.Dataset | None
    flow: tuple[FlowRows, ...]
    """One a rate."""
    rgb_us: NDArray[np.int64]
    depth_us: NDArray[np.int64]
    """(n,) timestamps of colour and depth."""
    chunks: ChunkWriter
    """Compresses images while the next ones are rendered."""

    @property
    def instants_us(self) -> NDArray[np.int64]:
        """Timestamps (n,) at which there is a frame of colour or depth, or might be, whatever streams are written."""
        return np.union1d(self.rgb_us, self.depth_us)

    def render(self, timestamp_us: int) -> None:
        """Write colour and depth at ``timestamp_us``, where they have a frame, and the flow that starts there."""
        rgb_row = _row_at(self.rgb_us, timestamp_us) if self.rgb is not None else None
        depth_row = _row_at(self.depth_us, timestamp_us) if self.depth is not None else None
        # Flow intervals that start at this frame: where they are stored, and their row there.
        starts = ((rows, _row_at(rows.intervals_us[:, 0], timestamp_us)) for rows in self.flow)
        starting = [(rows, k) for rows, k in starts if k is not None]
        needs_depth = depth_row is not None or bool(starting)
        if rgb_row is None and not needs_depth:
            return
        camera, world = colour_camera(self.scene.camera), self.world.at(timestamp_us)
        T_world_camera = camera.pose_at(self.flight, timestamp_us)
        if self.rgb is not None and rgb_row is not None:
            self._write(self.rgb, rgb_row, as_8_bit(world.rgb_dn(camera, T_world_camera)))
        if not needs_depth:
            return
        inverse_depth = in_range(world.inverse_depth_per_m(camera, T_world_camera), self.scene.depth_range_m)
        if self.depth is not None and depth_row is not None:
            self._write(self.depth, depth_row, depth_mm(inverse_depth))
        if starting:
            bodies = world.visible_bodies(camera, T_world_camera)
            for rows, k in starting:
                end_us = int(rows.intervals_us[k, 1])
                poses, times_us = (T_world_camera, camera.pose_at(self.flight, end_us)), (timestamp_us, end_us)
                self._write(rows.flow, k, scene_flow_px(world, camera, inverse_depth, bodies, poses, times_us))
                if rows.moving is not None:
                    self._write(rows.moving, k, (bodies > 0).astype(np.uint8))

    def _write(self, dataset: h5py.Dataset, row: int, image: NDArray[np.generic]) -> None:
        """Write an image, which is a chunk, in the type of its dataset; it must not be changed afterwards."""
        self.chunks.write(dataset, row, image[np.newaxis])


def _row_at(times_us: NDArray[np.int64], time_us: int) -> int | None:
    """Return the row of a time in ascending times (n,); None where it is not among them."""
    row = int(np.searchsorted(times_us, time_us))
    return row if row < len(times_us) and times_us[row] == time_us else None


def as_8_bit(radiance_dn: Floats) -> NDArray[np.uint8]:
    """``rint(clip(Y))``: what the frame stores of linear radiance."""
    codes = np.empty(radiance_dn.shape, np.uint8)

    def fill(_: int, first: int, stop: int) -> None:
        rows_dn = np.clip(radiance_dn[first:stop], 0, DN_MAX)
        codes[first:stop] = np.rint(rows_dn, out=rows_dn)

    in_threads(fill, len(codes))
    return codes


def in_range(inverse_depth_per_m: Floats, depth_range_m: tuple[float, float]) -> Floats:
    """Inverse depth with NaN where the z-depth is nearer or farther than the range, whose ends belong to it.

    The stored millimetres decide, so that rounding makes no holes in a wall at the very end of the range.
    """
    stored_mm = depth_mm(inverse_depth_per_m)
    near_mm, far_mm = (np.float32(MM_PER_M * end_m) for end_m in depth_range_m)
    return np.where((stored_mm >= near_mm) & (stored_mm <= far_mm), inverse_depth_per_m, np.nan)


def depth_mm(inverse_depth_per_m: Floats) -> NDArray[np.float32]:
    """Z-depth in millimetres as the file stores it; NaN stays NaN, and the sky (0) is at infinity."""
    z_mm = np.empty(inverse_depth_per_m.shape, np.float32)

    def fill(_: int, first: int, stop: int) -> None:
        with np.errstate(divide="ignore", over="ignore"):
            z_mm[first:stop] = MM_PER_M / inverse_depth_per_m[first:stop]

    in_threads(fill, len(z_mm))
    return z_mm


def create_frames(
    file: h5py.File,
    chunks: ChunkWriter,
    scene: Scene,
    world: RenderedWorld,
    duration_us: int,
    streams: frozenset[str],
) -> FrameRenderer:
    """Create the datasets and metadata of the image streams among ``streams``.

    Parameters
    ----------
    file
        An open file without these streams.
    chunks
        Writes the images. Its caller finishes it.
    scene
        Its camera, flight and depth range.
    duration_us
        Length of the sequence, us.
    streams
        Names of streams, of which rgb, depth and flow are created.
    """
    camera, rates = colour_camera(scene.camera), scene.rates
    rgb_us, depth_us = (timestamps_us(duration_us, rate_hz) for rate_hz in (rates.frames_hz, rates.of_depth_hz))
    size = {"H": camera.height, "W": camera.width, "H_rgb": camera.height, "W_rgb": camera.width}
    rgb = depth = None
    if "rgb" in streams:
        rgb = create_dataset(file, "path/rgb", {"N": len(rgb_us), **size}, level=_LEVEL)
        rgb.attrs["transfer"] = "linear"
        write_dataset(file, "path/rgb_ts", rgb_us, N=len(rgb_us))
        write_camera(file, "rgb", camera)
    if "depth" in streams:
        depth = create_dataset(file, "path/depth", {"D": len(depth_us), **size}, level=_LEVEL)
        write_dataset(file, "path/depth_ts", depth_us, D=len(depth_us))
        write_camera(file, "depth", camera)
        write_depth_range(file, scene)
    flow: list[FlowRows] = []
    if "flow" in streams:
        write_flow(file, moves=world.moves)
        for rate_hz in rates.flow_hz:
            intervals, rate = intervals_us(duration_us, rate_hz), rate_text(rate_hz)
            key, count = f"path/flow/{rate}hz", {f"K{rate}": len(intervals)}
            field = create_dataset(file, key, {**count, **size}, level=_LEVEL)
            moving = create_dataset(file, f"{key}_moving", {**count, **size}, level=_LEVEL) if world.moves else None
            flow.append(FlowRows(intervals, field, moving))
            write_dataset(file, f"{key}_ts", intervals, **count)
    return FrameRenderer(scene, world, scene.fly(), rgb, depth, tuple(flow), rgb_us, depth_us, chunks)


def write_imu_stream(file: h5py.File, scene: Scene, duration_us: int, seed: np.random.SeedSequence) -> None:
    """Write all inertial samples and their metadata.

    Parameters
    ----------
    file
        An open file without the stream.
    scene
        Its flight and inertial unit.
    duration_us
        Length of the sequence, us.
    seed
        Of the noise.
    """
    imu, flight, timestamps = (
        Imu(scene.imu, np.random.default_rng(seed)),
        scene.fly(),
        timestamps_us(duration_us, scene.imu.rate_hz),
    )
    names = ("angular_velocity", "linear_acceleration", "ts")
    rates, forces, times = (create_dataset(file, f"path/imu/{name}", {"M": len(timestamps)}) for name in names)
    for rows, times_us in _rows(timestamps):
        samples = imu.sample(flight, times_us)
        rates[rows], forces[rows] = samples.angular_velocities_body_rad_s, samples.specific_forces_body_m_s2
        times[rows] = times_us
    write_imu(file, scene)


def write_pose_stream(file: h5py.File, scene: Scene, duration_us: int, seed: np.random.SeedSequence) -> None:
    """Write all poses and their metadata.

    Parameters
    ----------
    file
        An open file without the stream.
    duration_us
        Length of the sequence, us.
    seed
        Of the noise.
    """
    sensor = PoseSensor(scene.pose, np.random.default_rng(seed))
    timestamps = timestamps_us(duration_us, scene.rates.pose_hz)
    flight, names = scene.fly(), ("position", "orientation", "ts")
    positions, orientations, times = (
        create_dataset(file, f"path/pose/{name}", {"P": len(timestamps)}) for name in names
    )
    for rows, times_us in _rows(timestamps):
        samples = sensor.sample(flight, times_us)
        positions[rows], orientations[rows] = samples.positions_world_m, samples.orientations_xyzw
        times[rows] = times_us
    write_pose(file, scene)


def _rows(timestamps: NDArray[np.int64]) -> Iterator[tuple[slice, NDArray[np.int64]]]:
    start = 0
    for piece in pieces(timestamps):
        yield slice(start, start + len(piece)), piece
        start += len(piece)
