"""A stream, an effect or a wind that is not asked for is never touched: held by worlds and parts that refuse to be."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_generator.camera import Camera
from fedora_generator.events import noise
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.events.sensor import EventSensor
from fedora_generator.flight import Flight
from fedora_generator.flights.gusts import WindOptions
from fedora_generator.flights.kinds import HoverOptions
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.render import ExactWorld
from fedora_generator.scene import load_scene

COLOUR, EVENT = 72, 32
"""Widths of the two cameras."""

METHODS = ("rgb_dn", "luma_dn", "inverse_depth_per_m")

PARK = load_scene("park-day").with_size(72, 54)

Floats = np.ndarray[Any, np.dtype[np.float64]]


def never(*_: object, **__: object) -> Any:
    raise AssertionError("Expected what was not asked for to be left alone")


def asked_for(monkeypatch: pytest.MonkeyPatch, target: Path, *streams: str) -> set[tuple[str, int]]:
    """What is rendered for some streams of a short flight, by method and by the width of the camera."""
    asked: set[tuple[str, int]] = set()

    def counting(name: str) -> Callable[..., Floats]:
        render = getattr(ExactWorld, name)

        def ask(world: ExactWorld, camera: Camera, T_world_camera: Floats) -> Floats:
            asked.add((name, camera.width))
            answer: Floats = render(world, camera, T_world_camera)
            return answer

        return ask

    for name in METHODS:
        monkeypatch.setattr(ExactWorld, name, counting(name))
    generate_sequence(PARK, target, Request(duration_s=0.04, streams=frozenset(streams), quality="draft"))
    return asked


def test_imu_and_pose_need_no_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither rendered nor made ready to be: for meshes no graphics is opened and nothing is painted."""
    for name in ("generate.render_surroundings", "generate.open_context", "mesh.places.TexturedMesh"):
        monkeypatch.setattr(f"fedora_generator.{name}", never)
    for name in METHODS:
        monkeypatch.setattr(ExactWorld, name, never)
    request = Request(duration_s=0.1, streams=frozenset({"imu", "pose"}))
    for scene in (PARK, load_scene("park-mesh-day")):
        generate_sequence(scene, tmp_path / f"{scene.name}.h5", request)
        with h5py.File(tmp_path / f"{scene.name}.h5") as file:
            assert set(file["path"]) == {"imu", "pose"}


@pytest.mark.parametrize(
    ("streams", "rendered"),
    [
        (("rgb",), {("rgb_dn", COLOUR)}),
        (("depth",), {("inverse_depth_per_m", COLOUR)}),
        (("flow",), {("inverse_depth_per_m", COLOUR)}),
        (("rgb", "imu", "pose"), {("rgb_dn", COLOUR)}),
        (("depth", "flow", "pose"), {("inverse_depth_per_m", COLOUR)}),
    ],
)
def test_only_the_images_of_the_streams_are_rendered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, streams: tuple[str, ...], rendered: set[tuple[str, int]]
) -> None:
    """No colour without rgb, no depth without depth or flow, nothing in the event camera without events."""
    assert asked_for(monkeypatch, tmp_path / "a.h5", *streams) == rendered


def test_events_are_rendered_in_their_own_camera(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Luma in the event camera; nothing in the colour camera."""
    asked = asked_for(monkeypatch, tmp_path / "a.h5", "events")
    assert ("luma_dn", EVENT) in asked
    assert not [name for name, width in asked if width == COLOUR]
    assert not [name for name, _ in asked if name == "rgb_dn"]


def test_flow_is_rendered_only_where_an_interval_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last frame starts none: one depth image less than there are frames."""
    renders: list[int] = []
    render = ExactWorld.inverse_depth_per_m

    def counted(world: ExactWorld, camera: Camera, T_world_camera: Floats) -> Floats:
        renders.append(camera.width)
        return render(world, camera, T_world_camera)

    monkeypatch.setattr(ExactWorld, "inverse_depth_per_m", counted)
    generate_sequence(PARK, tmp_path / "a.h5", Request(duration_s=0.1, streams=frozenset({"flow"})))
    assert len(renders) == 5


EFFECTS = {
    "LowPass": {"bandwidth_hz": 100.0},
    "PoissonEvents.take_until": {"shot_rate_hz": 1.0},
    "drop_refractory": {"refractory_us": 10},
    "align_to_packets": {"packet_interval_us": 200},
}


def guard(monkeypatch: pytest.MonkeyPatch, part: str) -> None:
    monkeypatch.setattr(f"fedora_generator.events.sensor.{part}", never)


def show(options: EventSensorOptions) -> int:
    """Number of events of a sensor that is shown three images."""
    sensor = EventSensor(options, 6, 8, np.random.SeedSequence(0))
    images = [np.full((6, 8), value) for value in (20.0, 60.0, 90.0)]
    sensor.start(0, images[0])
    return sum(len(sensor.advance(1_000_000 * step, image)) for step, image in enumerate(images[1:], start=1))


def test_effects_of_zero_are_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """No filter, no spurious source, no refractory memory, no packets, no draw of thresholds: the plain sensor."""
    for part in EFFECTS:
        guard(monkeypatch, part)
    assert show(EventSensorOptions(model="log", threshold_on=0.2, threshold_off=0.2)) == 6 * 8 * 7


@pytest.mark.parametrize("part", EFFECTS)
def test_an_effect_that_is_asked_for_is_there(monkeypatch: pytest.MonkeyPatch, part: str) -> None:
    """What the guards above guard is what the effect is made of."""
    guard(monkeypatch, part)
    options = EventSensorOptions(model="log", threshold_on=0.2, threshold_off=0.2)
    with pytest.raises(AssertionError, match="left alone"):
        show(replace(options, **EFFECTS[part]))


def test_equal_thresholds_are_one_row() -> None:
    """Without mismatch no threshold is drawn, and none is kept for each pixel."""

    class Refusing:
        normal = staticmethod(never)

    thresholds = noise.draw_thresholds(0.2, 0.0, (480, 640), Refusing())  # type: ignore[arg-type]
    assert thresholds.shape == (1, 640)
    assert np.all(thresholds == 0.2)


def test_a_calm_draws_no_gusts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quadrotor without wind never asks for one; with a wind it does."""
    monkeypatch.setattr("fedora_generator.flight.draw_gusts", never)
    calm = HoverOptions(position_m=(0.0, 0.0, 4.0), drag_per_s=0.3)
    assert Flight(calm, 1).states_at(np.zeros(1)).positions_world_m.tolist() == [[0.0, 0.0, 4.0]]
    with pytest.raises(AssertionError, match="left alone"):
        Flight(replace(calm, wind=WindOptions(speed_m_s=4.0)), 1)
