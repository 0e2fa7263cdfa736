"""Measures the mesh world against the exact world: ``make study-mesh``, some minutes on two cores.

Prints the tables of generator/fedora_generator/mesh/README.md. ``workbench`` is the world and the flight. ``agreement``
compares depth and radiance, ``event_timing`` compares events. ``stock`` is the depth of pyrender's own renderer,
``interpolation`` a trial with fewer renders.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import astuple
from typing import Final

import click
import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera, CameraOptions, colour_camera, event_camera
from fedora_generator.flight import Flight
from fedora_generator.mesh.from_world import model_of_world
from fedora_generator.mesh.model import MeshDetail
from fedora_generator.mesh.world import MeshWorld
from fedora_generator.render import ExactWorld
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.sampling import MotionSteps
from tests.benchmarks.mesh_study.agreement import depth_disagreement, edges, radiance_disagreement
from tests.benchmarks.mesh_study.event_timing import Luma, TimingError, compare, record
from tests.benchmarks.mesh_study.interpolation import FlowInterpolation
from tests.benchmarks.mesh_study.stock import stock_inverse_depth_per_m
from tests.benchmarks.mesh_study.workbench import DAY, FLIGHT, WORKBENCH, path_world_m

Floats = NDArray[np.float64]

SIZE: Final = CameraOptions(width=720, height=540)
POSES_US: Final = (0, 150_000, 300_000, 450_000)
FLOW_US: Final = 20_000
TIMED_US: Final = 100_000
TEXEL_RAD: Final = 1e-3
KEY_STEPS_US: Final = (5_000, 20_000)

DETAILS: Final = {
    "8bit, factor 1": MeshDetail(precision="8bit", event_factor=1),
    "8bit, factor 4": MeshDetail(precision="8bit", event_factor=4),
    "float, factor 1": MeshDetail(event_factor=1),
    "float, factor 2": MeshDetail(event_factor=2),
    "float, factor 4": MeshDetail(event_factor=4),
    "float, factor 8": MeshDetail(event_factor=8),
}


@click.command()
def main() -> None:
    """Print the tables of mesh/README.md."""
    exact = ExactWorld.of(WORKBENCH, DAY)
    model = model_of_world(WORKBENCH, path_world_m(), texel_rad=TEXEL_RAD)
    worlds = {name: MeshWorld.of(model, DAY, detail) for name, detail in DETAILS.items()}
    for line in (*_depth_table(exact, worlds["float, factor 4"]), "", *_radiance_table(exact, worlds), ""):
        click.echo(line)
    for line in _timing_table(exact, worlds):
        click.echo(line)


def _depth_table(exact: ExactWorld, mesh: MeshWorld) -> Iterator[str]:
    """Depth and flow of the colour camera, the worst of all poses."""
    camera, model = colour_camera(SIZE), model_of_world(WORKBENCH, path_world_m(), texel_rad=1.0)
    sources: dict[str, Callable[[Camera, Floats], Floats]] = {
        "reversed float32, pixel centre": mesh.inverse_depth_per_m,
        "pyrender: 24 bit, first of 4 samples": lambda camera, T: stock_inverse_depth_per_m(model, camera, T),
    }
    yield "| depth | median of d(1/z) z | 99.9% | largest | other surface, px | flow over 20 ms, largest px |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name, source in sources.items():
        rows = []
        for time_us in POSES_US:
            T, T_end = _pose(camera, time_us), _pose(camera, time_us + FLOW_US)
            exact_per_m = exact.inverse_depth_per_m(camera, T)
            rows.append(astuple(depth_disagreement(exact_per_m, source(camera, T), camera, T, T_end)))
        yield f"| {name} | " + " | ".join(f"{value:.2g}" for value in np.max(rows, axis=0)) + " |"


def _radiance_table(exact: ExactWorld, worlds: dict[str, MeshWorld]) -> Iterator[str]:
    """Log luminance of the event camera, inside surfaces and at their edges, over all poses."""
    camera = event_camera(SIZE)
    poses = [_pose(camera, time_us) for time_us in POSES_US]
    exact_dn = np.array([exact.luma_dn(camera, T) for T in poses])
    at_edges = np.array([edges(exact.inverse_depth_per_m(camera, T)) for T in poses])
    yield "| luminance, 1e-3 nat | inside: rms | 99% | largest | at edges: rms | 99% | largest | CPU ms an image |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- |"
    coarse = {
        f"float, factor 4, texels {texel_rad:g} rad": MeshWorld.of(
            model_of_world(WORKBENCH, path_world_m(), texel_rad=texel_rad), DAY
        )
        for texel_rad in (2e-3, 4e-3)
    }
    for name, world in {**worlds, **coarse}.items():
        started = time.process_time()
        mesh_dn = np.array([world.luma_dn(camera, T) for T in poses])
        cost_ms = 1e3 * (time.process_time() - started) / len(poses)
        parts = [radiance_disagreement(exact_dn, mesh_dn, where) for where in (~at_edges, at_edges)]
        cells = [f"{1e3 * value:.2g}" for part in parts for value in astuple(part)]
        yield f"| {name} | {' | '.join(cells)} | {cost_ms:.0f} |"


def _timing_table(exact: ExactWorld, worlds: dict[str, MeshWorld]) -> Iterator[str]:
    """Events against those of the exact world at the same instants."""
    camera = event_camera(SIZE)
    times_us = _times_us(exact, camera, bound_px=0.5)
    truth = record(_luma_of(exact, camera), times_us)
    yield f"| events: {len(truth)} in {len(times_us)} images | wrong pixels | median us | rms us | 99% us | CPU s |"
    yield "| --- | --- | --- | --- | --- | --- |"
    finest = record(_luma_of(exact, camera), _times_us(exact, camera, bound_px=0.1))
    yield _timing_row("exact, 5 times as many images (what the sampling costs)", compare(truth, finest))
    lumas: dict[str, Luma] = {name: _luma_of(world, camera) for name, world in worlds.items()}
    for step_us in KEY_STEPS_US:
        moved = FlowInterpolation(worlds["float, factor 4"], camera, lambda t: _pose(camera, t), step_us)
        lumas[f"float, factor 4, every {step_us // 1000} ms, moved along the flow between"] = moved.luma_dn
    errors = {}
    for name, luma in lumas.items():
        started = time.process_time()
        errors[name] = record(luma, times_us)
        yield _timing_row(name, compare(truth, errors[name]), f"{time.process_time() - started:.0f}")
    for factor in (1, 4):
        error = compare(errors[f"float, factor {factor}"], errors[f"8bit, factor {factor}"])
        yield _timing_row(f"8bit against float, both factor {factor} (what 8 bits alone cost)", error)


def _timing_row(name: str, error: TimingError, seconds: str = "") -> str:
    cells = (f"{100 * error.wrong_share:.2f}%", *(f"{v:.0f}" for v in (error.median_us, error.rms_us, error.p99_us)))
    return f"| {name} | {' | '.join(cells)} | {seconds} |"


def _times_us(exact: ExactWorld, camera: Camera, bound_px: float) -> NDArray[np.int64]:
    sampling = MotionSteps(exact, camera, Flight(FLIGHT), bound_px)
    starts_us = range(0, TIMED_US, FLOW_US)
    return np.concatenate([[0], *(sampling.times_us(start_us, start_us + FLOW_US) for start_us in starts_us)])


def _luma_of(world: RenderedWorld, camera: Camera) -> Luma:
    return lambda time_us: world.luma_dn(camera, _pose(camera, time_us))


def _pose(camera: Camera, time_us: int) -> Floats:
    return camera.pose_at(Flight(FLIGHT), time_us)


if __name__ == "__main__":
    main()
