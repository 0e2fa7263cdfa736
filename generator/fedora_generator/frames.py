"""The streams on the grid of the colour camera: RGB, depth and flow, one instant at a time."""

from dataclasses import dataclass
from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import colour_camera
from fedora_generator.depth import depth_mm, in_range
from fedora_generator.flight import Flight
from fedora_generator.flow import scene_flow_px
from fedora_generator.instants import FRAME_RATE_HZ, intervals_us, timestamps_us
from fedora_generator.metadata import write_camera, write_depth_range, write_flow
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.scene import Scene
from fedora_generator.write import write_dataset
from fedora_qa.conventions import FLOW_RATES_HZ
from fedora_qa.layout.create import create_dataset

Floats = NDArray[np.float64]

DN_MAX: Final = 255


@dataclass(frozen=True, slots=True)
class FlowRows:
    """The flow of one rate: its field of each interval, and where anything moves what of it does."""

    intervals_us: NDArray[np.int64]
    """(k, 2)"""
    flow: h5py.Dataset
    moving: h5py.Dataset | None


@dataclass(frozen=True, slots=True)
class FrameRenderer:
    """Renders the frames that were asked for into their datasets, in any order, each once."""

    scene: Scene
    world: RenderedWorld
    flight: Flight
    rgb: h5py.Dataset | None
    depth: h5py.Dataset | None
    flow: dict[int, FlowRows]
    """By rate in hertz."""

    def render(self, index: int, timestamp_us: int) -> None:
        """Write everything that belongs to frame ``index`` at ``stamp_us``: the flow of intervals that start here."""
        starting = self._flow_from(index)
        needs_depth = self.depth is not None or bool(starting)
        if self.rgb is None and not needs_depth:
            return
        camera, world = colour_camera(self.scene.camera), self.world.at(timestamp_us)
        T_world_camera = self._pose_at(timestamp_us)
        if self.rgb is not None:
            self.rgb[index] = as_8_bit(world.rgb_dn(camera, T_world_camera))
        if not needs_depth:
            return
        inverse_depth = in_range(world.inverse_depth_per_m(camera, T_world_camera), self.scene.depth_range_m)
        if self.depth is not None:
            self.depth[index] = depth_mm(inverse_depth)
        if starting:
            self._write_flow(starting, world, inverse_depth, timestamp_us)

    def _write_flow(
        self, starting: list[tuple[FlowRows, int]], world: RenderedWorld, inverse_depth: Floats, start_us: int
    ) -> None:
        camera, start_pose = colour_camera(self.scene.camera), self._pose_at(start_us)
        bodies = world.bodies_seen(camera, start_pose)
        for rows, k in starting:
            end_us = int(rows.intervals_us[k, 1])
            poses, times_us = (start_pose, self._pose_at(end_us)), (start_us, end_us)
            rows.flow[k] = scene_flow_px(world, camera, inverse_depth, bodies, poses, times_us)
            if rows.moving is not None:
                rows.moving[k] = bodies > 0

    def _flow_from(self, index: int) -> list[tuple[FlowRows, int]]:
        """Each flow interval that starts at a frame: where it is kept, and its row there."""
        fields = []
        for rate_hz, rows in self.flow.items():
            k, rest = divmod(index * rate_hz, FRAME_RATE_HZ)
            if rest == 0 and k < len(rows.intervals_us):
                fields.append((rows, k))
        return fields

    def _pose_at(self, time_us: int) -> Floats:
        return colour_camera(self.scene.camera).pose_at(self.flight, time_us)


def as_8_bit(radiance_dn: Floats) -> NDArray[np.uint8]:
    """``rint(clip(Y))``: what the frame stores of linear radiance."""
    return np.rint(np.clip(radiance_dn, 0, DN_MAX)).astype(np.uint8)


def create_frames(
    file: h5py.File, scene: Scene, world: RenderedWorld, duration_us: int, streams: frozenset[str]
) -> FrameRenderer:
    """Create the datasets and metadata of the image streams among ``streams``."""
    camera, timestamps = colour_camera(scene.camera), timestamps_us(duration_us, FRAME_RATE_HZ)
    size = {"H": camera.height, "W": camera.width, "H_rgb": camera.height, "W_rgb": camera.width}
    rgb = depth = None
    if "rgb" in streams:
        rgb = create_dataset(file, "path/rgb", {"N": len(timestamps), **size})
        rgb.attrs["transfer"] = "linear"
        write_dataset(file, "path/rgb_ts", timestamps, N=len(timestamps))
        write_camera(file, "rgb", camera)
    if "depth" in streams:
        depth = create_dataset(file, "path/depth", {"D": len(timestamps), **size})
        write_dataset(file, "path/depth_ts", timestamps, D=len(timestamps))
        write_camera(file, "depth", camera)
        write_depth_range(file, scene)
    flow = {}
    if "flow" in streams:
        write_flow(file, moves=world.moves)
        for rate_hz in FLOW_RATES_HZ:
            intervals = intervals_us(duration_us, rate_hz)
            key, count = f"path/flow/{rate_hz}hz", {f"K{rate_hz}": len(intervals)}
            field = create_dataset(file, key, {**count, **size})
            moving = create_dataset(file, f"{key}_moving", {**count, **size}) if world.moves else None
            flow[rate_hz] = FlowRows(intervals, field, moving)
            write_dataset(file, f"{key}_ts", intervals, **count)
    return FrameRenderer(scene, world, scene.fly(), rgb, depth, flow)
