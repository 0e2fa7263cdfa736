"""The followed sensor against the closed form: which events, and when."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fedora_generator.adaptive import follower
from fedora_generator.adaptive.follower import Follower
from fedora_generator.camera import event_camera
from fedora_generator.events.keys import EventBatch, KeyLayout, decode
from fedora_generator.events.sensor import EventSensor, Pixels
from fedora_generator.flight import Flight, FlightOptions
from fedora_generator.render import ExactWorld
from fedora_generator.sampling import FIDELITY, Fidelity
from fedora_generator.scene import load_scene
from fedora_generator.threads import NUMBA_CONFIG
from tests.benchmarks.event_timing import THRESHOLD, Truth, followed, timing_error, truth_of
from tests.benchmarks.timing_scenes import TEXTURES, TimingScene
from tests.generator.event_sensor_cases import as_rows, join, options

TIMED_US = 100_000
STEP_NS = 20_000_000
RMS_US = {"draft": 10.0, "standard": 5.0, "reference": 0.2}


@pytest.fixture(scope="module")
def truths() -> dict[str, Truth]:
    """Events of 48 pixels of both walls, by bisection of the closed form."""
    return {texture: truth_of(TimingScene.named(texture), TIMED_US) for texture in TEXTURES}


def follow(
    scene: TimingScene, stop_ns: int, fidelity: Fidelity = FIDELITY["standard"], **changes: object
) -> EventBatch:
    """Record a scene with a sensor that follows its light."""
    sensor = EventSensor(options(**changes), scene.camera.height, scene.camera.width, np.random.SeedSequence(0))
    sensor.start(0, scene.luma_dn(0.0))
    source = Follower(scene.world, scene.camera, scene.flight, fidelity)
    batches = [sensor.follow(end_ns, source) for end_ns in range(STEP_NS, stop_ns + 1, STEP_NS)]
    return join([*batches, sensor.finish()])


@pytest.mark.parametrize("quality", FIDELITY)
@pytest.mark.parametrize("texture", TEXTURES)
def test_every_event_is_there_and_on_time(texture: str, quality: str, truths: dict[str, Truth]) -> None:
    """No wrong sequence, and an RMS error on the internal clock of at most 10, 5 (standard) or 0.2 us (reference)."""
    recording = followed(TimingScene.named(texture), FIDELITY[quality], TIMED_US)  # type: ignore[index]
    error = timing_error(recording, truths[texture])
    assert error.events > 80
    assert error.wrong_pixels == 0
    assert error.rms_us < RMS_US[quality]


@pytest.mark.parametrize("texture", TEXTURES)
def test_the_signal_is_between_its_thresholds_at_all_times(texture: str) -> None:
    """At random instants of random pixels |L - ref| < C, ref counted from the events; stamps are up to 1 us late."""
    scene = TimingScene.named(texture)
    events = follow(scene, 3 * STEP_NS)
    first = np.log(scene.luma_dn(0.0))
    rng = np.random.default_rng(1)
    for column, row in zip(rng.integers(0, 40, 60).tolist(), rng.integers(0, 30, 60).tolist(), strict=True):
        mine = (events.x == column) & (events.y == row)
        times_us, signs = events.t_us[mine], np.where(events.p[mine] == 1, 1, -1)
        for time_s in rng.uniform(0, 0.06, 20).tolist():
            if np.abs(times_us - time_s * 1e6).min(initial=math.inf) > 30:
                reference = first[row, column] + THRESHOLD * signs[times_us < time_s * 1e6].sum()
                assert abs(scene.log_luma(column, row, time_s) - reference) < THRESHOLD


def test_the_signal_that_is_left_is_that_of_the_image() -> None:
    """After following, the sensor stands where an image at that time would have put it, to 1e-11."""
    scene = TimingScene.named("sharp")
    signal = np.log(scene.luma_dn(0.0) + 2.5)
    threshold = np.full((1, 40), THRESHOLD)
    pixels = Pixels(
        reference=signal.copy(), signal=signal, threshold_on=threshold, threshold_off=threshold, log_eps_dn=2.5
    )
    Follower(scene.world, scene.camera, scene.flight, FIDELITY["draft"]).crossings(pixels, 0, STEP_NS)
    np.testing.assert_allclose(pixels.signal, np.log(scene.luma_dn(0.02) + 2.5), atol=1e-11)
    assert np.abs(pixels.signal - pixels.reference).max() < THRESHOLD


def test_what_moves_is_followed_too() -> None:
    """Past a cart and a drone that move, the sensor ends where the image of that time would."""
    scene = load_scene("park-traffic").with_size(360, 270)
    world, camera, flight = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera), scene.fly()
    signal = np.log(world.at(0).luma_dn(camera, camera.pose_at(flight, 0)))
    threshold = np.full((1, camera.width), THRESHOLD)
    pixels = Pixels(reference=signal.copy(), signal=signal, threshold_on=threshold, threshold_off=threshold)
    keys = Follower(world, camera, flight, FIDELITY["standard"]).crossings(pixels, 0, 100_000_000)
    expected = np.log(world.at(100_000).luma_dn(camera, camera.pose_at(flight, 100_000)))
    np.testing.assert_allclose(pixels.signal, expected, atol=1e-10)
    assert np.abs(pixels.signal - pixels.reference).max() < THRESHOLD
    moving = world.at(100_000).visible_bodies(camera, camera.pose_at(flight, 100_000)) > 0
    layout = KeyLayout(camera.height, camera.width)
    events = decode(keys, layout, 0)
    assert moving[events.y, events.x].sum() > 100


@pytest.mark.parametrize("name", ["park-day", "racetrack", "fast-turn", "park-traffic"])
def test_on_whole_scenes_events_are_those_of_a_dense_movie(name: str) -> None:
    """Against 50 000 images a second, between edges, corners and things that move: the same events.

    Stamps are within a step of the movie, and 99% of them within 2 us.
    """
    scene = load_scene(name).with_size(90, 68)
    world, camera, flight = ExactWorld.of(scene.world, scene.light), event_camera(scene.camera), scene.fly()
    start_us, stop_us, step_us = 960_000, 970_000, 20
    first = world.at(start_us).luma_dn(camera, camera.pose_at(flight, start_us))
    sensitive = options(threshold_on=0.012, threshold_off=0.012)
    movie, light = (EventSensor(sensitive, 30, 40, np.random.SeedSequence(0)) for _ in range(2))
    movie.start(start_us * 1000, first)
    light.start(start_us * 1000, first)
    followed_events = light.follow(stop_us * 1000, Follower(world, camera, flight, FIDELITY["standard"]))
    shown = join(
        movie.advance(time_us * 1000, world.at(time_us).luma_dn(camera, camera.pose_at(flight, time_us)))
        for time_us in range(start_us + step_us, stop_us + 1, step_us)
    )
    one, other = (np.lexsort((batch.t_us, batch.x, batch.y)) for batch in (followed_events, shown))
    assert len(shown) > 100
    for column in ("x", "y", "p"):
        np.testing.assert_array_equal(getattr(followed_events, column)[one], getattr(shown, column)[other])
    late_us = np.abs(followed_events.t_us[one] - shown.t_us[other])
    assert late_us.max() <= step_us
    assert np.quantile(late_us, 0.99) <= 2


def test_leak_raises_the_reference_of_a_still_pixel() -> None:
    """A wall that stands still: each pixel fires leak_rate_hz times a second, at the multiples of its period."""
    scene = replace(TimingScene.named("smooth"), flight=Flight(FlightOptions(position_m=(0.0, 0.0, 2.0))))
    events = follow(scene, 10 * STEP_NS, leak_rate_hz=29.0)
    assert len(events) == 5 * 40 * 30  # the sixth would come at 207 ms
    np.testing.assert_array_equal(np.unique(events.t_us), np.ceil(np.arange(1, 6) * 1e6 / 29))
    assert (events.p == 1).all()


def test_thresholds_may_differ_between_pixels() -> None:
    """With mismatch, every pixel of the wall fires as it would alone with the threshold it has."""
    scene = TimingScene.named("smooth")
    sensor = EventSensor(options(threshold_sigma=0.03), 30, 40, np.random.SeedSequence(5))
    sensor.start(0, scene.luma_dn(0.0))
    source = Follower(scene.world, scene.camera, scene.flight, FIDELITY["standard"])
    events = sensor.follow(STEP_NS, source)
    on, off = sensor.thresholds
    first, last = np.log(scene.luma_dn(0.0)), np.log(scene.luma_dn(0.02))
    net = np.zeros((30, 40))
    np.add.at(net, (events.y, events.x), np.where(events.p == 1, on[events.y, events.x], -off[events.y, events.x]))
    assert np.unique(on).size > 1000
    assert ((last - first - net < on) & (last - first - net > -off)).all()


def test_images_may_follow_light() -> None:
    """20 ms of light, then an image at 40 ms: every pixel's net change explains the whole way to within a threshold."""
    scene = TimingScene.named("sharp")
    sensor = EventSensor(options(), 30, 40, np.random.SeedSequence(0))
    sensor.start(0, scene.luma_dn(0.0))
    source = Follower(scene.world, scene.camera, scene.flight, FIDELITY["standard"])
    events = join([sensor.follow(STEP_NS, source), sensor.advance(2 * STEP_NS, scene.luma_dn(0.04))])
    net = np.zeros((30, 40))
    np.add.at(net, (events.y, events.x), THRESHOLD * np.where(events.p == 1, 1, -1))
    change = np.log(scene.luma_dn(0.04)) - np.log(scene.luma_dn(0.0))
    assert np.abs(change).max() > 5 * THRESHOLD
    assert np.abs(change - net).max() < THRESHOLD


def test_the_result_does_not_depend_on_threads_or_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """One thread or two, room for all events of a tile or for one: the same events, bit for bit."""
    scene = TimingScene.named("sharp")
    expected = as_rows(follow(scene, 2 * STEP_NS, threshold_on=0.05, threshold_off=0.05))
    monkeypatch.setattr(follower, "FIRST_CAPACITY", 1)
    assert as_rows(follow(scene, 2 * STEP_NS, threshold_on=0.05, threshold_off=0.05)) == expected
    for threads in (2, 3):
        monkeypatch.setattr(NUMBA_CONFIG, "NUMBA_NUM_THREADS", threads)
        assert as_rows(follow(scene, 2 * STEP_NS, threshold_on=0.05, threshold_off=0.05)) == expected
    assert len(expected) > 4000


def test_how_time_is_cut_moves_no_event_by_more_than_rounding() -> None:
    """In steps of 20 ms or of 5 ms: the same events, stamps within 1 us."""
    scene = TimingScene.named("smooth")
    coarse = follow(scene, 2 * STEP_NS, FIDELITY["reference"])
    sensor = EventSensor(options(), 30, 40, np.random.SeedSequence(0))
    sensor.start(0, scene.luma_dn(0.0))
    source = Follower(scene.world, scene.camera, scene.flight, FIDELITY["reference"])
    fine = join([sensor.follow(end_ns, source) for end_ns in range(5_000_000, 2 * STEP_NS + 1, 5_000_000)])
    one, other = (np.lexsort((batch.t_us, batch.x, batch.y)) for batch in (coarse, fine))
    for name in ("x", "y", "p"):
        np.testing.assert_array_equal(getattr(coarse, name)[one], getattr(fine, name)[other])
    assert np.abs(coarse.t_us[one] - fine.t_us[other]).max() <= 1


@pytest.mark.parametrize("texture", TEXTURES)
def test_what_has_no_logarithm_is_named(texture: str) -> None:
    """A wall that is below black in places, or just black on its dark checkers: the message of the images."""
    scene = TimingScene.named(texture)
    dark_dn = scene.world.grey.dark_dn
    grey = scene.world.grey._replace(dark_dn=-dark_dn if texture == "smooth" else 0 * dark_dn)
    black = replace(scene.world, grey=grey)
    sensor = EventSensor(options(), 30, 40, np.random.SeedSequence(0))
    sensor.start(0, scene.luma_dn(0.0))
    with pytest.raises(ValueError, match=r"got \d+ pixels without a logarithm, first \(column \d+, row \d+\)"):
        sensor.follow(STEP_NS, Follower(black, scene.camera, scene.flight, FIDELITY["draft"]))


@pytest.mark.parametrize("changes", [{"bandwidth_hz": 300.0}, {"model": "linear", "threshold_on": 5.0}])
def test_sensors_that_compare_images_are_refused(changes: dict[str, object]) -> None:
    """A bandwidth remembers, and the linear model compares images: neither follows light."""
    scene = TimingScene.named("smooth")
    with pytest.raises(ValueError, match="Expected a log sensor without a bandwidth"):
        follow(scene, STEP_NS, **changes)
