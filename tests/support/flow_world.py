"""A world in closed form for the checks of flow: a camera that flies along a textured plane, every stream in memory.

Nothing here uses the mathematics under test: rotations are scipy's, points are carried from one camera to the other
through the world, and frames are the plane's own texture, evaluated where each pixel's ray meets it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Camera, Declared, PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Sampling, Span, Window
from fedora_qa.views.storage_steps import image_step
from tests.support.facts import MS, clock

Float64 = NDArray[np.float64]
Rows = Mapping[str, NDArray[Any]]

WIDTH, HEIGHT = 192, 144
K = np.array([[170.0, 0.0, 97.3], [0.0, 165.0, 70.1], [0.0, 0.0, 1.0]])
T_BODY_CAMERA = np.eye(4)
T_BODY_CAMERA[:3, :3] = (
    np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    @ Rotation.from_rotvec([0.1, -0.15, 0.08]).as_matrix()
)
T_BODY_CAMERA[:3, 3] = (0.12, -0.05, 0.03)

DURATION_NS = 400 * MS
WINDOW_NS = 200 * MS
PLANE_NORMAL, PLANE_DISTANCE_M = np.array([0.9, 0.25, -0.35]), 6.0
_WAVES = np.random.default_rng(5)
_WAVE_VECTORS_PER_M = _WAVES.uniform(-14.0, 14.0, (40, 3))
_WAVE_PHASES = _WAVES.uniform(0.0, 2 * np.pi, 40)


def body_pose(time_s: float) -> tuple[Rotation, Float64]:
    """The flight: a swaying turn while moving past the plane."""
    attitude = Rotation.from_euler(
        "ZYX", [0.5 * time_s + 0.1 * np.sin(5 * time_s), 0.15 * time_s, 0.2 * np.sin(4 * time_s)]
    )
    position_m = np.array(
        [1.5 * time_s + 0.1 * np.sin(6 * time_s), -1.2 * time_s, 0.4 * time_s + 0.05 * np.cos(5 * time_s)]
    )
    return attitude, position_m


def pixel_grid() -> tuple[Float64, Float64]:
    columns, rows = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    return columns, rows


def rays_body(K_camera: Float64 = K) -> Float64:
    """Rays (H, W, 3) in the body frame, of unit z-depth."""
    columns, rows = pixel_grid()
    rays = np.stack([(columns - K_camera[0, 2]) / K_camera[0, 0], (rows - K_camera[1, 2]) / K_camera[1, 1],
                     np.ones_like(columns)], axis=-1)  # fmt: skip
    return rays @ T_BODY_CAMERA[:3, :3].T


def depth_m(time_s: float) -> Float64:
    """z-depth (H, W) at which each ray meets the plane."""
    attitude, position_m = body_pose(time_s)
    centre = position_m + attitude.apply(T_BODY_CAMERA[:3, 3])
    directions = attitude.apply(rays_body().reshape(-1, 3)).reshape(HEIGHT, WIDTH, 3)
    return (PLANE_DISTANCE_M - PLANE_NORMAL @ centre) / (directions @ PLANE_NORMAL)


def world_points(time_s: float) -> Float64:
    """Where each pixel's ray meets the plane, (H, W, 3)."""
    attitude, position_m = body_pose(time_s)
    in_body = rays_body() * depth_m(time_s)[..., None] + T_BODY_CAMERA[:3, 3]
    return attitude.apply(in_body.reshape(-1, 3)).reshape(HEIGHT, WIDTH, 3) + position_m


def true_flow_px(start_s: float, end_s: float) -> Float64:
    """Flow (H, W, 2): the points that are seen at the start, projected at the end."""
    attitude, position_m = body_pose(end_s)
    in_body = attitude.inv().apply((world_points(start_s) - position_m).reshape(-1, 3))
    optical = (in_body - T_BODY_CAMERA[:3, 3]) @ T_BODY_CAMERA[:3, :3]
    projected = (optical / optical[:, 2:]) @ K.T
    return projected[:, :2].reshape(HEIGHT, WIDTH, 2) - np.stack(pixel_grid(), axis=-1)


def frame_dn(time_s: float, contrast_dn: float = 70.0) -> NDArray[np.uint8]:
    """The colour frame (H, W, 3), grey, rounded to 8 bits."""
    phases = world_points(time_s) @ _WAVE_VECTORS_PER_M.T + _WAVE_PHASES
    grey = 120.0 + contrast_dn * np.sqrt(2 / len(_WAVE_PHASES)) * np.cos(phases).sum(axis=-1)
    return np.repeat(np.clip(np.rint(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


@dataclass(frozen=True)
class FlowWorld:
    """Facts and rows of a file that exists only in memory."""

    facts: Facts
    rows_by_key: Rows

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        return self.rows_by_key[key][start:stop]

    def event_index(self, time_ns: int) -> int:
        return 0

    def windows(self, sampling: Sampling) -> list[Window]:
        spans = []
        for index, start_ns in enumerate(range(0, DURATION_NS + 1, WINDOW_NS)):
            owned = {}
            for stream, its_clock in self.facts.clocks.items():
                inside = (its_clock.times_ns >= start_ns) & (its_clock.times_ns < start_ns + WINDOW_NS)
                owned[stream] = (
                    (int(np.argmax(inside)), int(np.argmax(inside)) + int(inside.sum())) if inside.any() else (0, 0)
                )
            spans.append(Span(index, start_ns, start_ns + WINDOW_NS, owned))
        return [Window(span, self.facts, self, sampling) for span in spans]

    def with_rows(self, **changes: NDArray[Any]) -> "FlowWorld":
        """The same file with other rows; underscores stand for slashes: ``path_depth``, ``path_flow_10hz``."""
        keys = {key.replace("/", "_"): key for key in self.rows_by_key}
        rows = {**self.rows_by_key, **{keys[name]: values for name, values in changes.items()}}
        return replace(self, rows_by_key=rows)

    def with_flow(self, change: Callable[[str, NDArray[np.float32]], NDArray[Any]]) -> "FlowWorld":
        """The same file with every rate's fields (K, H, W, 2) changed."""
        changed = {
            f"path/{stream}": np.asarray(change(stream, self.rows_by_key[f"path/{stream}"]), dtype=np.float32)
            for stream in self.facts.flow_streams
        }
        return replace(self, rows_by_key={**self.rows_by_key, **changed})

    def declaring(self, **changes: Any) -> "FlowWorld":
        """The same file with other declarations."""
        return replace(self, facts=replace(self.facts, declared=replace(self.facts.declared, **changes)))

    def without(self, stream: str) -> "FlowWorld":
        """The same file without a stream."""
        clocks = {name: kept for name, kept in self.facts.clocks.items() if name != stream}
        return replace(self, facts=replace(self.facts, streams=self.facts.streams - {stream}, clocks=clocks))


def make_world(
    rates_hz: tuple[int, ...] = (10, 25, 50), *, contrast_dn: float = 70.0, noise: PoseModel | None = None
) -> FlowWorld:
    """Render the file; ``noise`` is declared and added to the poses."""
    frames_ns, poses_ns = np.arange(0, DURATION_NS + 1, 20 * MS), np.arange(-50 * MS, DURATION_NS + 50 * MS + 1, 5 * MS)
    clocks = {"rgb": clock(frames_ns), "depth": clock(frames_ns), "pose": clock(poses_ns)}
    seconds = frames_ns / 1e9
    rows: dict[str, NDArray[Any]] = {
        "path/rgb": np.stack([frame_dn(t, contrast_dn) for t in seconds]),
        "path/depth": np.stack([1000 * depth_m(t) for t in seconds]).astype(np.float32),
    }
    for rate_hz in rates_hz:
        period_ns = 1000 * MS // rate_hz
        starts_ns = np.arange(0, DURATION_NS, period_ns)
        clocks[f"flow/{rate_hz}hz"] = clock(starts_ns, period_ns)
        fields = [true_flow_px(start / 1e9, (start + period_ns) / 1e9) for start in starts_ns]
        rows[f"path/flow/{rate_hz}hz"] = np.stack(fields).astype(np.float32)
    noise = noise or PoseModel()
    rows["path/pose/position"], rows["path/pose/orientation"] = _poses(poses_ns / 1e9, noise)
    camera = Camera(WIDTH, HEIGHT, K, T_BODY_CAMERA)
    facts = Facts(
        layout=Layout("fedora", {}, frozenset(), {}),
        declared=Declared(cameras={"rgb": camera, "depth": camera}, pose=noise, flow_model="rigid"),
        streams=frozenset(clocks),
        absent={},
        origin_us=0,
        clocks=clocks,
        events=None,
        index_maps={},
        sizes={key: len(values) for key, values in rows.items()},
    )
    return FlowWorld(facts, rows)


def _poses(times_s: Float64, noise: PoseModel) -> tuple[Float64, Float64]:
    rng = np.random.default_rng(17)
    poses = [body_pose(t) for t in times_s]
    attitudes = Rotation.concatenate([attitude for attitude, _ in poses])
    attitudes = attitudes * Rotation.from_rotvec(noise.rotation_sigma_rad * rng.standard_normal((len(poses), 3)))
    positions_m = np.stack([position for _, position in poses])
    return positions_m + noise.position_sigma_m * rng.standard_normal(positions_m.shape), attitudes.as_quat()


def observe(check: Check[Any], world: FlowWorld, *, tile_share: float = 1.0, follow_up: bool = True) -> Observation:
    """Run one check over the whole file, with the second look that it asks for."""
    if len(world.rows_by_key.get("path/depth", ())):  # as the survey of a file infers it
        step = image_step(world.rows_by_key["path/depth"][0])
        world = replace(world, facts=replace(world.facts, steps={**world.facts.steps, "path/depth": step}))
    windows = world.windows(Sampling(tile_share=tile_share))
    state = check.start(world.facts)
    for window in windows:
        check.update(state, window)
    if follow_up:
        for index in check.follow_up_windows(state, world.facts):
            check.follow_up(state, windows[index])
    return check.conclude(state, world.facts)


def judged(check: Check[Any], world: FlowWorld, **options: Any) -> Judged:
    """Run one check and judge it."""
    return judge({check.name: observe(check, world, **options)}, [check], 1e-4)[0]
