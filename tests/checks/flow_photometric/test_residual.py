"""Flow is held against frames: clean files pass, small and gross faults are found, placed, sized and named."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.flow_photometric.residual import FlowPhotometricResidual
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.judgement.materiality import Materiality
from tests.support.flow_world import (
    HEIGHT,
    T_BODY_CAMERA,
    WIDTH,
    FlowWorld,
    K,
    body_pose,
    depth_m,
    judged,
    make_world,
    observe,
    pixel_grid,
)


@cache
def clean() -> FlowWorld:
    return make_world((25, 50))


def causes(result: Judged) -> set[tuple[str, str]]:
    """The first hypothesis for every alarm."""
    assert result.result.outcome == "failed"
    first = [hypotheses_of(alarm, clean().facts)[0] for alarm in result.alarms]
    return {(hypothesis.cause, hypothesis.stream) for hypothesis in first}


def value_of(result: Judged, name: str) -> float:
    return next(m.value for m in result.result.measurements if m.name == name and m.value is not None)


def with_rgb(world: FlowWorld, rgb: np.ndarray) -> FlowWorld:
    return world.with_rows(path_rgb=np.ascontiguousarray(rgb))


@pytest.mark.parametrize("without", ["nothing", "depth", "pose"])
def test_clean_file_passes(without: str) -> None:
    """Residuals lie within a few thousandths of a pixel, with depth and pose and, more weakly, without."""
    world = clean() if without == "nothing" else clean().without(without)
    result = judged(FlowPhotometricResidual(), world)
    assert result.result.outcome == "passed"
    for rate in ("flow/25hz", "flow/50hz"):
        assert abs(value_of(result, f"{rate} residual_u")) < 0.005
        assert abs(value_of(result, f"{rate} gain")) < 0.3


def test_unit_is_inferred_from_the_frames() -> None:
    """The frames say that flow is in px an interval, or px/s, whatever a label says."""
    assert observe(FlowPhotometricResidual(), clean()).inferred["flow_unit"] == "px"
    per_second = clean().with_flow(lambda stream, flow: flow * float(stream.split("/")[1][:-2]))
    assert observe(FlowPhotometricResidual(), per_second).inferred["flow_unit"] == "px/s"


@pytest.mark.parametrize("percent", [2.0, -5.0, 25.0])
def test_gain_is_measured(percent: float) -> None:
    """A gain of a few percent is found and its size recovered to a tenth."""
    result = judged(FlowPhotometricResidual(), clean().with_flow(lambda _, flow: flow * (1 + percent / 100)))
    assert ("flow_gain", "flow") in causes(result)
    assert value_of(result, "flow/25hz gain") == pytest.approx(percent, rel=0.1, abs=0.2)


@pytest.mark.parametrize("factor", [64.0, 8.0])
def test_rounding_down_matters_by_its_effect_on_the_flow(factor: float) -> None:
    """Flow that is floored to 1/64 px errs by 0.008 px, which fails no release; that of 1/8 px fails all profiles."""
    floored = clean().with_flow(lambda _, flow: np.floor(flow * factor) / factor)
    check = FlowPhotometricResidual()
    observations = {check.name: observe(check, floored)}
    failed = {}
    for profile in ("strict", "release"):
        (result,) = judge(observations, [check], 1e-4, Materiality(profile))
        failed[profile] = {alarm.finding.code.rpartition(".")[2] for alarm in result.alarms}
    assert {"mean", "template"} <= failed["strict"]
    assert bool(failed["release"]) == (factor < 64)


def test_constant_error_is_measured_with_its_sign() -> None:
    """0.1 px to the right and 0.2 px up is what is reported."""
    result = judged(FlowPhotometricResidual(), clean().with_flow(lambda _, flow: flow + np.array([0.1, -0.2])))
    assert value_of(result, "flow/50hz residual_u") == pytest.approx(0.1, abs=0.01)
    assert value_of(result, "flow/50hz residual_v") == pytest.approx(-0.2, abs=0.01)


GROSS = {
    "sign": (lambda _, flow: -flow, "flow_sign"),
    "axes": (lambda _, flow: flow[..., ::-1], "axes_swapped"),
    "quarter turn": (lambda _, flow: flow[..., ::-1] * np.array([-1, 1]), "frame_convention"),
    "px/ms": (lambda stream, flow: flow * float(stream.split("/")[1][:-2]) / 1000, "flow_unit"),
    "px/s": (lambda stream, flow: flow * float(stream.split("/")[1][:-2]), "flow_unit"),
    "px s": (lambda stream, flow: flow / float(stream.split("/")[1][:-2]), "flow_unit"),
}


@pytest.mark.parametrize(("change", "cause"), GROSS.values(), ids=GROSS)
def test_gross_fault_of_flow_is_named(change: object, cause: str) -> None:
    """Faults beyond the capture range are found by tiles that do not match and named by undoing them."""
    result = judged(FlowPhotometricResidual(), clean().with_flow(change))  # type: ignore[arg-type]
    assert (cause, "flow") in causes(result)


def test_mirrored_frames_are_named() -> None:
    """Colour frames turned left to right are the frames' fault, not the flow's."""
    assert ("mirrored", "rgb") in causes(
        judged(FlowPhotometricResidual(), with_rgb(clean(), clean().rows_by_key["path/rgb"][:, :, ::-1]))
    )


def test_frames_out_of_step_are_named() -> None:
    """Frames that show what was seen one frame step, 20 ms, before their stamps."""
    rgb = clean().rows_by_key["path/rgb"]
    late = with_rgb(clean(), np.concatenate([rgb[:1], rgb[:-1]]))
    result = judged(FlowPhotometricResidual(), late)
    assert ("time_offset", "rgb") in causes(result)
    delays = [
        hypothesis
        for alarm in result.alarms
        for hypothesis in hypotheses_of(alarm, clean().facts)
        if hypothesis.cause == "time_offset" and hypothesis.magnitude
    ]
    assert delays[0].magnitude == pytest.approx(20.0)


def test_swapped_frames_are_placed() -> None:
    """Two exchanged neighbours spoil the fields about them only; the worst field lies there."""
    rgb = clean().rows_by_key["path/rgb"].copy()
    rgb[[9, 10]] = rgb[[10, 9]]
    result = judged(FlowPhotometricResidual(), with_rgb(clean(), rgb))
    assert ("swapped_frames", "rgb") in causes(result)
    worst = next(
        a for a in result.alarms if a.finding.code.endswith(".field") and a.finding.where.stream == "flow/50hz"
    )
    assert worst.finding.where.index_start in (8, 9, 10)


@pytest.mark.parametrize(("error_px", "rule"), [(0.6, "tile"), (8.0, "tile_match")])
def test_local_fault_is_placed(error_px: float, rule: str) -> None:
    """One tile of one field that is off is found, with its tile: within the capture range in px, beyond it at all."""
    flow = clean().rows_by_key["path/flow/50hz"].copy()
    flow[7, 40:72, 48:80] += error_px
    result = judged(FlowPhotometricResidual(), clean().with_rows(path_flow_50hz=flow))
    places = [a.finding.where for a in result.alarms if a.finding.code == f"flow_photometric.residual.{rule}"]
    assert [(w.stream, w.index_start, w.tile) for w in places] == [("flow/50hz", 7, (48, 40, 80, 72))]


def test_brightness_may_change() -> None:
    """Frames that darken by 3% from one to the next say nothing about flow."""
    rgb = clean().rows_by_key["path/rgb"].astype(float)
    fading = np.rint(rgb * 0.97 ** np.arange(len(rgb))[:, None, None, None]).astype(np.uint8)
    assert judged(FlowPhotometricResidual(), with_rgb(clean(), fading)).result.outcome == "passed"


def test_frames_without_texture_are_not_observable() -> None:
    """A plain wall can tell nothing, and says so instead of passing."""
    plain = np.full_like(clean().rows_by_key["path/rgb"], 90)
    result = judged(FlowPhotometricResidual(), with_rgb(clean(), plain))
    assert result.result.outcome == "not_observable"
    assert "texture" in result.result.reason


def with_noise(world: FlowWorld, sigma_dn: float) -> FlowWorld:
    rgb = world.rows_by_key["path/rgb"]
    noise = np.random.default_rng(8).normal(0.0, sigma_dn, rgb.shape[:3])[..., None]
    return with_rgb(world, np.clip(np.rint(rgb + noise), 0, 255).astype(np.uint8))


def test_noise_that_would_draw_the_estimate_to_zero_withholds_the_verdict() -> None:
    """Frames of 0.5 DN contrast under noise of 1 DN cannot tell 0.3 px, and say so; of 6 DN they read nine tenths."""
    pushed = [
        with_noise(make_world((50,), contrast_dn=contrast), 1.0).with_flow(lambda _, flow: flow + np.array([0.3, 0.0]))
        for contrast in (0.5, 6.0)
    ]
    assert judged(FlowPhotometricResidual(), pushed[0]).result.outcome == "not_observable"
    assert value_of(judged(FlowPhotometricResidual(), pushed[1]), "flow/50hz residual_u") == pytest.approx(0.3, rel=0.1)


def made_with(K_wrong: np.ndarray, roll_deg: float = 0.0) -> FlowWorld:
    """Flow made by another camera, or one that rolls by so much more in each interval."""

    def remade(stream: str, flow: np.ndarray) -> np.ndarray:
        period_ns = 1_000_000_000 // int(stream.split("/")[1][:-2])
        starts_s = np.arange(len(flow)) * period_ns / 1e9
        return np.stack([_flow_of(K_wrong, t, t + period_ns / 1e9, roll_deg) for t in starts_s])

    return clean().with_flow(remade)


def _flow_of(K_camera: np.ndarray, start_s: float, end_s: float, roll_deg: float) -> np.ndarray:
    rays = np.linalg.inv(K_camera) @ np.stack([*pixel_grid(), np.ones((HEIGHT, WIDTH))]).reshape(3, -1)
    points = (rays * depth_m(start_s).ravel()).T @ T_BODY_CAMERA[:3, :3].T + T_BODY_CAMERA[:3, 3]
    (R0, p0), (R1, p1) = body_pose(start_s), body_pose(end_s)
    moved = R1.inv().apply(R0.apply(points) + p0 - p1) - T_BODY_CAMERA[:3, 3]
    moved = Rotation.from_euler("z", roll_deg, degrees=True).apply(moved @ T_BODY_CAMERA[:3, :3])
    projected = (moved / moved[:, 2:]) @ K_camera.T
    return projected[:, :2].reshape(HEIGHT, WIDTH, 2) - np.stack(pixel_grid(), axis=-1)


MADE_WRONG = {
    "focal": (K * np.array([[1.02, 1, 1], [1, 1.02, 1], [1, 1, 1]]), 0.0, 2.0, 0.1),
    "centre_u": (K + np.array([[0, 0, 3.0], [0, 0, 0], [0, 0, 0]]), 0.0, 3.0, 0.3),
    "roll": (K, 0.05, 0.05, 0.002),
}


@pytest.mark.parametrize(("name", "case"), MADE_WRONG.items(), ids=MADE_WRONG)
def test_template_measures_its_fault(name: str, case: tuple[np.ndarray, float, float, float]) -> None:
    """Flow made with a wrong camera, or a camera that rolls further, is measured in the fault's unit, with its sign."""
    K_wrong, roll_deg, size, within = case
    result = judged(FlowPhotometricResidual(), made_with(K_wrong, roll_deg))
    assert value_of(result, f"flow/25hz {name}") == pytest.approx(size, abs=within)


def test_part_of_the_image_is_named() -> None:
    """Flow that points backwards in a quarter of the image is named although most tiles match."""
    flow = {key: values.copy() for key, values in clean().rows_by_key.items() if "flow" in key}
    for values in flow.values():
        values[:, HEIGHT // 2 :, WIDTH // 2 :] *= -1
    result = judged(
        FlowPhotometricResidual(),
        clean().with_rows(path_flow_25hz=flow["path/flow/25hz"], path_flow_50hz=flow["path/flow/50hz"]),
    )
    assert ("flow_sign", "flow") in causes(result)


def test_frames_of_another_size_are_mapped_through_the_cameras() -> None:
    """Colour frames of a camera with the same centre and 1.5 times the pixels measure the same."""
    world = clean()
    doubled = np.repeat(np.repeat(world.rows_by_key["path/rgb"], 2, axis=1), 2, axis=2)
    K_rgb = K * np.array([[2.0], [2.0], [1.0]])
    K_rgb[:2, 2] += 0.5  # the corner stays where it is: x_rgb + 1/2 = 2 (x + 1/2)
    rgb_camera = replace(world.facts.declared.cameras["rgb"], width=384, height=288, K=K_rgb)
    cameras = {**world.facts.declared.cameras, "rgb": rgb_camera}
    result = judged(FlowPhotometricResidual(), with_rgb(world, doubled).declaring(cameras=cameras))
    assert result.result.outcome == "passed"
    assert result.result.coverage is not None
    assert result.result.coverage.share == 1.0


def test_camera_elsewhere_is_not_applicable() -> None:
    """A colour camera with a centre of its own would need reprojection, and that is said."""
    camera = clean().facts.declared.cameras["rgb"]
    T = camera.T_body_camera.copy()
    T[0, 3] += 0.1
    cameras = {**clean().facts.declared.cameras, "rgb": replace(camera, T_body_camera=T)}
    assert "position of the depth camera" in FlowPhotometricResidual().not_applicable(
        clean().declaring(cameras=cameras).facts
    )


def test_frames_between_intervals_are_not_observable() -> None:
    """Frames whose stamps are none of flow's cannot be compared with it."""
    facts = clean().facts
    rgb = facts.clocks["rgb"]
    clocks = {**facts.clocks, "rgb": replace(rgb, times_ns=rgb.times_ns + 7)}
    observation = observe(FlowPhotometricResidual(), replace(clean(), facts=replace(facts, clocks=clocks)))
    assert "colour frame" in observation.unobservable


def test_evidence_is_small_and_titled() -> None:
    """After an alarm the worst field is drawn, by tiles, with a title for each picture."""
    observation = observe(FlowPhotometricResidual(), clean().with_flow(lambda _, flow: -flow))
    assert observation.evidence
    assert set(observation.evidence) == set(observation.titles)
    assert all(max(picture.shape) <= 200 for picture in observation.evidence.values())


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_coverage_counts_tiles(share: float) -> None:
    """A share of the tiles of each field is that share, not all fields."""
    coverage = judged(FlowPhotometricResidual(), clean(), tile_share=share).result.coverage
    assert coverage is not None
    assert coverage.unit == "tiles of flow fields"
    assert coverage.share == pytest.approx(share, abs=0.1)
