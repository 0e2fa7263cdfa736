"""The measurements of the mesh world against the exact one: their arithmetic, and what they find."""

import numpy as np
import pytest

from fedora_generator.camera import CameraOptions, colour_camera, event_camera
from fedora_generator.events.keys import EventBatch
from fedora_generator.flight import Flight
from fedora_generator.mesh.from_world import model_of_world
from fedora_generator.mesh.model import MeshDetail, MeshModel
from fedora_generator.mesh.world import MeshWorld
from fedora_generator.render import ExactWorld
from tests.benchmarks.mesh_study.agreement import depth_disagreement, edges, radiance_disagreement
from tests.benchmarks.mesh_study.event_timing import compare, record
from tests.benchmarks.mesh_study.interpolation import FlowInterpolation
from tests.benchmarks.mesh_study.stock import stock_inverse_depth_per_m
from tests.benchmarks.mesh_study.workbench import DAY, FLIGHT, WORKBENCH, path_world_m

SIZE = CameraOptions(width=270, height=200)
POSE_US = 300_000


@pytest.fixture(scope="module")
def exact() -> ExactWorld:
    return ExactWorld.of(WORKBENCH, DAY)


@pytest.fixture(scope="module")
def model() -> MeshModel:
    return model_of_world(WORKBENCH, path_world_m(), texel_rad=3e-3)


def batch(*rows: tuple[int, int, int, int]) -> EventBatch:
    x, y, t_us, p = np.array(rows).T
    return EventBatch(x.astype(np.uint16), y.astype(np.uint16), t_us.astype(np.int64), p.astype(np.uint8))


def test_events_are_matched_pixel_by_pixel() -> None:
    """Of three pixels one has another sequence; the others are 10, 20 and 30 us apart."""
    truth = batch((0, 0, 100, 1), (1, 0, 150, 0), (0, 0, 200, 1), (2, 1, 300, 1))
    other = batch((0, 0, 110, 1), (1, 0, 150, 1), (0, 0, 180, 1), (2, 1, 330, 1))
    error = compare(truth, other)
    assert error.wrong_share == pytest.approx(1 / 3)
    assert error.median_us == 20
    assert error.rms_us == pytest.approx(np.sqrt((10**2 + 20**2 + 30**2) / 3))


def test_events_against_themselves_do_not_differ() -> None:
    """No wrong pixel and no delay."""
    events = batch((0, 0, 100, 1), (1, 0, 150, 0), (0, 0, 200, 0))
    error = compare(events, events)
    assert (error.wrong_share, error.rms_us, error.events) == (0.0, 0.0, 3)


def test_edges_are_where_one_over_z_is_bent() -> None:
    """A plane has none; a step and a crease have some, one pixel wide on each side."""
    rows, columns = np.mgrid[0:12, 0:12].astype(float)
    plane = 0.1 + 0.01 * columns + 0.02 * rows
    assert not edges(plane).any()
    step = np.where(columns < 6, 0.2, 0.5)
    assert np.flatnonzero(edges(step)[6]).tolist() == [4, 5, 6, 7]


@pytest.mark.usefixtures("opengl")
def test_depth_and_flow_of_both_worlds_agree_to_float32(exact: ExactWorld, model: MeshModel) -> None:
    """1/z within 1e-4 where both see one surface, 1e-6 nearly everywhere; flow within 1e-3 px; few edges differ."""
    camera = colour_camera(SIZE)
    T, T_end = (camera.pose_at(Flight(FLIGHT), time_us) for time_us in (POSE_US, POSE_US + 20_000))
    mesh = MeshWorld.of(model, DAY)
    found = depth_disagreement(
        exact.inverse_depth_per_m(camera, T), mesh.inverse_depth_per_m(camera, T), camera, T, T_end
    )
    assert found.median < 2e-7
    assert found.p999 < 2e-6
    assert found.largest < 1e-4
    assert found.flow_largest_px < 1e-3
    assert found.other_surface_pixels <= 5


@pytest.mark.usefixtures("opengl")
def test_the_depth_of_pyrender_is_that_of_another_place_of_the_pixel(exact: ExactWorld, model: MeshModel) -> None:
    """Its first sample lies beside the centre, which on the ground is worth a thousand times float32."""
    camera = colour_camera(SIZE)
    T = camera.pose_at(Flight(FLIGHT), POSE_US)
    exact_per_m = exact.inverse_depth_per_m(camera, T)
    found = depth_disagreement(exact_per_m, stock_inverse_depth_per_m(model, camera, T), camera, T, T)
    assert 2e-4 < found.median < 1e-2
    # It left OpenGL as pyrender wants it; the next image of ours is right again.
    ours = MeshWorld.of(model, DAY).inverse_depth_per_m(camera, T)
    assert depth_disagreement(exact_per_m, ours, camera, T, T).median < 2e-7


@pytest.mark.usefixtures("opengl")
def test_intensity_of_both_worlds_agrees_within_the_texture(exact: ExactWorld, model: MeshModel) -> None:
    """Inside surfaces by less than 1% rms, at edges less than 3%; eight bits are worse than floats."""
    camera = event_camera(SIZE)
    T = camera.pose_at(Flight(FLIGHT), POSE_US)
    exact_dn = exact.luma_dn(camera, T)
    at_edges = edges(exact.inverse_depth_per_m(camera, T))
    fine, coarse = (
        MeshWorld.of(model, DAY, MeshDetail(precision=precision, event_factor=4)).luma_dn(camera, T)
        for precision in ("float", "8bit")
    )
    assert radiance_disagreement(exact_dn, fine, ~at_edges).rms < 0.01
    assert radiance_disagreement(exact_dn, fine, at_edges).rms < 0.03
    assert radiance_disagreement(fine, coarse, ~at_edges).rms > 3e-4


def test_images_moved_along_the_flow_are_those_of_the_exact_world(exact: ExactWorld) -> None:
    """Halfway between two renders 4 ms apart, most pixels are right to 1%; at the renders all are."""
    camera = event_camera(SIZE)
    flight = Flight(FLIGHT)
    moved = FlowInterpolation(exact, camera, lambda time_us: camera.pose_at(flight, time_us), step_us=4_000)
    np.testing.assert_array_equal(moved.luma_dn(8_000), exact.luma_dn(camera, camera.pose_at(flight, 8_000)))
    halfway = np.log(moved.luma_dn(10_000) / exact.luma_dn(camera, camera.pose_at(flight, 10_000)))
    assert np.quantile(np.abs(halfway), 0.9) < 0.02


def test_recording_keeps_the_order_of_time(exact: ExactWorld) -> None:
    """Events of all images, ascending, each within the time shown."""
    camera = event_camera(CameraOptions(width=90, height=68))
    flight = Flight(FLIGHT)
    times_us = np.arange(0, 20_001, 2_000)
    events = record(lambda time_us: exact.luma_dn(camera, camera.pose_at(flight, time_us)), times_us)
    assert len(events) > 0
    assert (np.diff(events.t_us) >= 0).all()
    assert 0 < events.t_us[0] <= events.t_us[-1] <= 20_000
