"""Flow is held against depth and pose: clean files pass to rounding, faults are found, placed, sized and named."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.transform import Rotation

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.flow_geometry.endpoint import FlowGeometryEndpoint, correction_growth
from fedora_qa.diagnosis.flow_geometry import noise_likeness
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.vetoes import is_flow_of_a_part
from fedora_qa.judgement.judge import Judged
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.views.flow_comparison import FieldError
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import Interval
from tests.support.flow_world import (
    T_BODY_CAMERA,
    FlowWorld,
    K,
    body_pose,
    judged,
    make_world,
    observe,
    pixel_grid,
    rays_body,
)

NOISE = PoseModel(position_sigma_m=0.005, rotation_sigma_rad=np.radians(0.2))


@cache
def clean() -> FlowWorld:
    return make_world((10, 25))


@cache
def noisy() -> FlowWorld:
    return make_world((25,), noise=NOISE)


def with_mover(marked: bool) -> FlowWorld:
    """A world in which a patch of 30 x 40 pixels moves by itself, 2 px an interval; masks say so, or nothing."""
    world = clean()
    moving = np.zeros(world.rows_by_key["path/depth"].shape[1:], np.uint8)
    moving[20:50, 30:70] = 1
    off = world.with_flow(lambda _, flow: flow + 2.0 * moving[..., None])
    masks = {
        f"path/{stream}_moving": np.repeat(marked * moving[None], len(world.rows_by_key[f"path/{stream}"]), axis=0)
        for stream in world.facts.flow_streams
    }
    sizes = {**off.facts.sizes, **{key: len(mask) for key, mask in masks.items()}}
    facts = replace(off.facts, sizes=sizes, declared=replace(off.facts.declared, flow_model="scene"))
    return replace(off, facts=facts, rows_by_key={**off.rows_by_key, **masks})


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_what_moves_by_itself_is_left_out_where_it_is_marked(share: float) -> None:
    """A patch with a flow of its own passes under its mask, fails without, and a gain of the rest is still found."""
    assert judged(FlowGeometryEndpoint(), with_mover(marked=True), tile_share=share).result.outcome == "passed"
    assert judged(FlowGeometryEndpoint(), with_mover(marked=False), tile_share=share).result.outcome == "failed"
    gain = with_mover(marked=True).with_flow(lambda _, flow: flow * 1.02)
    hypothesis = most_probable_cause(gain, tile_share=share)
    assert (hypothesis.cause, hypothesis.stream) == ("flow_gain", "flow")


@pytest.mark.parametrize(("share", "step"), [(1.0, 1), (0.25, 4)])
def test_coverage_counts_pixels(share: float, step: int) -> None:
    """Every fourth row and column of each field is a sixteenth of its pixels, not all fields."""
    coverage = judged(FlowGeometryEndpoint(), clean(), tile_share=share).result.coverage
    fields = [values for key, values in clean().rows_by_key.items() if key.startswith("path/flow") and values.ndim == 4]
    assert coverage is not None
    assert coverage.unit == "pixels of flow fields"
    assert coverage.of == sum(values.shape[0] * values.shape[1] * values.shape[2] for values in fields)
    assert coverage.seen == coverage.of / step**2


def with_camera(world: FlowWorld, K_declared: np.ndarray = K, T: np.ndarray = T_BODY_CAMERA) -> FlowWorld:
    cameras = {
        name: replace(camera, K=K_declared, T_body_camera=T) for name, camera in world.facts.declared.cameras.items()
    }
    return world.declaring(cameras=cameras)


def first_hypothesis(result: Judged, world: FlowWorld) -> Hypothesis:
    assert result.result.outcome == "failed"
    return hypotheses_of(result.alarms[0], world.facts)[0]


def most_probable_cause(world: FlowWorld, **options: float) -> Hypothesis:
    return first_hypothesis(judged(FlowGeometryEndpoint(), world, **options), world)


@pytest.mark.parametrize("world", [clean, noisy], ids=["exact pose", "noisy pose"])
def test_clean_file_passes_to_rounding(world: object) -> None:
    """Nothing but rounding remains, whether the pose is exact or its declared noise has to be corrected."""
    result = judged(FlowGeometryEndpoint(), world())  # type: ignore[operator]
    assert result.result.outcome == "passed"
    errors = [m.value for m in result.result.measurements if m.name.endswith("endpoint_error")]
    assert max(errors) < 1e-5


@pytest.mark.parametrize("share", [0.05, 0.25])
def test_sampled_efforts_agree(share: float) -> None:
    """A coarser lattice passes the clean file and still finds a gain of 0.1%."""
    assert judged(FlowGeometryEndpoint(), clean(), tile_share=share).result.outcome == "passed"
    off = clean().with_flow(lambda _, flow: flow * 1.001)
    hypothesis = most_probable_cause(off, tile_share=share)
    assert hypothesis.magnitude == pytest.approx(0.1, rel=1e-2)


def resampled(flow: np.ndarray, shift_px: tuple[float, float]) -> np.ndarray:
    """Fields (n, H, W, 2) that lie to the right and down, straight between pixels; NaN where a neighbour is."""
    right, down = shift_px
    return np.asarray(ndimage.shift(flow, (0, down, right, 0), order=1, cval=np.nan))


VALUE_FAULTS = {
    "gain": (lambda _, flow: flow * 1.02, "flow_gain", 2.0),
    "doubled": (lambda _, flow: flow * 2, "flow_gain", 100.0),
    "v gained": (lambda _, flow: flow * np.array([1, 1.14]), "flow_gain", 14.0),
    "sign": (lambda _, flow: -flow, "flow_sign", None),
    "px/s": (lambda stream, flow: flow * float(stream.split("/")[1][:-2]), "flow_unit", 10.0),
    "px s": (lambda stream, flow: flow / float(stream.split("/")[1][:-2]), "flow_unit", 0.1),
    "px/ms": (lambda stream, flow: flow * float(stream.split("/")[1][:-2]) / 1000, "flow_unit", 0.01),
    "focal lengths": (lambda _, flow: flow / np.array([K[0, 0], K[1, 1]]), "flow_unit", None),
    "half images": (lambda _, flow: flow / (np.array(flow.shape[-2:-4:-1]) / 2), "flow_unit", None),
    "axes": (lambda _, flow: flow[..., ::-1], "axes_swapped", None),
    "v up": (lambda _, flow: flow * np.array([1, -1]), "frame_convention", None),
    "u left": (lambda _, flow: flow * np.array([-1, 1]), "frame_convention", None),
    "v right, u up": (lambda _, flow: flow[..., ::-1] * np.array([1, -1]), "frame_convention", None),
    "v left, u down": (lambda _, flow: flow[..., ::-1] * np.array([-1, 1]), "frame_convention", None),
    "v left, u up": (lambda _, flow: -flow[..., ::-1], "frame_convention", None),
    "mirrored": (lambda _, flow: flow[:, :, ::-1], "mirrored", None),
    "shifted": (lambda _, flow: np.roll(flow, 3, axis=2), "spatial_offset", 3.0),
    "shifted both ways": (lambda _, flow: np.roll(flow, (2, -6), axis=(1, 2)), "spatial_offset", -np.hypot(6, 2)),
    "shifted by a part of a pixel": (lambda _, flow: resampled(flow, (0.28, 0.24)), "spatial_offset", 0.3688),
    "shifted by pixels and a part": (lambda _, flow: resampled(flow, (-2.6, 0.7)), "spatial_offset", -2.6926),
    "late": (lambda _, flow: np.concatenate([flow[:1], flow[:-1]]), "flow_interval_shifted", 1.0),
}


@cache
def judged_with(fault: str) -> Judged:
    """Judge the clean world with a fault of the values."""
    return judged(FlowGeometryEndpoint(), clean().with_flow(VALUE_FAULTS[fault][0]))


@pytest.mark.parametrize("fault", VALUE_FAULTS)
def test_fault_of_the_values_is_named(fault: str) -> None:
    """The first hypothesis is what was done to the fields, with its size; all rates are off, so flow as a whole is."""
    _, cause, magnitude = VALUE_FAULTS[fault]
    hypothesis = first_hypothesis(judged_with(fault), clean())
    assert (hypothesis.cause, hypothesis.stream) == (cause, "flow")
    if magnitude is not None:
        assert hypothesis.magnitude == pytest.approx(magnitude, rel=1e-3)


TWO_CONVENTIONS = {
    "v up": (lambda flow: flow * np.array([1, -1]), "frame_convention"),
    "u left": (lambda flow: flow * np.array([-1, 1]), "frame_convention"),
    "axes": (lambda flow: flow[..., ::-1], "axes_swapped"),
    "sign": (lambda flow: -flow, "flow_sign"),
}


UNITS_OF_BOTH_AXES = {"px/s": 10.0, "focal lengths": 1 / K[0, 0]}


@pytest.mark.parametrize(
    ("unit", "factor", "convention"),
    [
        *((unit, factor, name) for unit, factor in UNITS_OF_BOTH_AXES.items() for name in TWO_CONVENTIONS),
        # Where the unit differs between the axes, exchanging them before is not exchanging them after.
        *(("half images", 2 / 192, name) for name in ("v up", "sign")),
    ],
)
def test_two_conventions_at_once_are_both_proposed(unit: str, factor: float, convention: str) -> None:
    """Neither alone removes much: the unit with its factor, and what else was done to the vectors."""
    change, cause = TWO_CONVENTIONS[convention]
    in_unit = VALUE_FAULTS[unit][0]
    off = clean().with_flow(lambda stream, flow: change(in_unit(stream, flow)))
    result = judged(FlowGeometryEndpoint(), off)
    hypotheses = sorted(hypotheses_of(result.alarms[0], off.facts), key=lambda hypothesis: hypothesis.support)
    supports = {h.cause: h for h in hypotheses if h.stream == "flow"}
    assert supports["flow_unit"].support > 0.98
    assert supports["flow_unit"].magnitude == pytest.approx(factor, rel=1e-3)
    assert supports[cause].support > 0.98
    assert supports[cause].magnitude is None


def turning_px(start_s: float, end_s: float) -> np.ndarray:
    """Flow (H, W, 2) of a camera that turns and stays where it is."""
    start, end = body_pose(start_s)[0], body_pose(end_s)[0]
    optical = (end.inv() * start).apply(rays_body().reshape(-1, 3)) @ T_BODY_CAMERA[:3, :3]
    projected = (optical / optical[:, 2:]) @ K.T
    columns, rows = pixel_grid()
    return projected[:, :2].reshape(*columns.shape, 2) - np.stack([columns, rows], axis=-1)


@pytest.mark.parametrize("factors", [(1, 0), (0, 1), (1, 3)], ids=["turning alone", "without turning", "long way"])
def test_flow_of_a_part_of_the_motion_is_of_the_sequence(factors: tuple[float, float]) -> None:
    """It is of the turning and the way of the file, each by its own factor, which has no cause of the list in flow."""
    of_turning, of_way = factors

    def parts(stream: str, flow: np.ndarray) -> np.ndarray:
        clock = clean().facts.clocks[stream]
        assert clock.ends_ns is not None
        intervals_s = 1e-9 * np.stack([clock.times_ns, clock.ends_ns], axis=-1)
        turning = np.stack([turning_px(start_s, end_s) for start_s, end_s in intervals_s])
        return of_turning * turning + of_way * (flow - turning)

    off = clean().with_flow(parts)
    result = judged(FlowGeometryEndpoint(), off)
    assert is_flow_of_a_part(result.alarms)
    hypotheses = [h for alarm in result.alarms for h in hypotheses_of(alarm, off.facts)]
    assert all(h.support < 0.2 for h in hypotheses if h.cause == "other_sequence" and h.stream == "flow")


@pytest.mark.parametrize("fault", ["gain", "v gained", "sign", "px/s", "v up", "shifted", "late"])
def test_other_faults_of_flow_are_of_no_part_of_the_motion(fault: str) -> None:
    """A gain and a unit have one factor for both parts; other faults leave more."""
    assert not is_flow_of_a_part(judged_with(fault).alarms)


def test_flow_of_zeros_is_of_no_part_of_the_motion() -> None:
    """Both parts with a factor of 0 say nothing."""
    result = judged(FlowGeometryEndpoint(), clean().with_flow(lambda _, flow: 0 * flow))
    assert not is_flow_of_a_part(result.alarms)


def test_one_rate_alone_is_named() -> None:
    """A gain in one rate is that rate's, and the other rates pass."""
    off = clean().with_flow(lambda stream, flow: flow * (1.01 if stream == "flow/25hz" else 1.0))
    result = judged(FlowGeometryEndpoint(), off)
    assert {alarm.finding.where.stream for alarm in result.alarms} == {"flow/25hz"}
    assert first_hypothesis(result, off).stream == "flow/25hz"


def test_rate_mixed_up_is_named() -> None:
    """10 Hz fields that hold the 50 Hz ones that begin with them belong to another rate."""
    world = make_world((10, 50))
    hypothesis = most_probable_cause(world.with_rows(path_flow_10hz=world.rows_by_key["path/flow/50hz"][::5]))
    assert (hypothesis.cause, hypothesis.stream) == ("flow_rate_mixed", "flow/10hz")


LONGER_K = K * np.array([[1.005, 1.0, 1.0], [1.0, 1.005, 1.0], [1.0, 1.0, 1.0]])
SHIFTED_K = K + np.array([[0.0, 0.0, 1.5], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
ROLLED_T = T_BODY_CAMERA.copy()
ROLLED_T[:3, :3] = T_BODY_CAMERA[:3, :3] @ Rotation.from_rotvec([0, 0, 0.5], degrees=True).as_matrix()
FORWARD_T = T_BODY_CAMERA.copy()
FORWARD_T[0, 3] += 0.1

METADATA_FAULTS = {
    "focal": (LONGER_K, T_BODY_CAMERA, "intrinsics_focal", 0.5),
    "centre": (SHIFTED_K, T_BODY_CAMERA, "intrinsics_centre", 1.5),
    "roll": (K, ROLLED_T, "extrinsic_rotation", 0.5),
    "arm": (K, FORWARD_T, "lever_arm", 0.1),
}


@pytest.mark.parametrize(("K_declared", "T", "cause", "size"), METADATA_FAULTS.values(), ids=METADATA_FAULTS)
@pytest.mark.parametrize("world", [clean, noisy], ids=["exact pose", "noisy pose"])
def test_fault_of_the_declared_camera_is_named(
    world: object, K_declared: np.ndarray, T: np.ndarray, cause: str, size: float
) -> None:
    """Wrong intrinsics show whatever the pose's noise; a wrong mounting needs an exact pose."""
    base: FlowWorld = world()  # type: ignore[operator]
    declared = with_camera(base, K_declared, T)
    result = judged(FlowGeometryEndpoint(), declared)
    if base is noisy() and cause in ("extrinsic_rotation", "lever_arm"):
        assert result.result.outcome == "passed"
        return
    hypothesis = first_hypothesis(result, declared)
    assert (hypothesis.cause, hypothesis.stream) == (cause, "metadata")
    assert hypothesis.magnitude == pytest.approx(size, rel=0.02)


def test_late_poses_are_measured() -> None:
    """Poses stamped 2 ms late are found, with sign and size."""
    world = clean()
    late = world.facts.clocks["pose"]
    clocks = {**world.facts.clocks, "pose": replace(late, times_ns=late.times_ns + 2_000_000)}
    hypothesis = most_probable_cause(replace(world, facts=replace(world.facts, clocks=clocks)))
    assert (hypothesis.cause, hypothesis.stream) == ("time_offset", "pose")
    assert hypothesis.magnitude == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("axes", [(2,), (1,), (1, 2)], ids=["columns", "rows", "both"])
def test_mirrored_depth_is_named(axes: tuple[int, ...]) -> None:
    """Undoing the fault of the depth makes flow agree, so the depth is suspected and not the flow."""
    mirrored = np.flip(clean().rows_by_key["path/depth"], axes)
    hypothesis = most_probable_cause(clean().with_rows(path_depth=mirrored))
    assert (hypothesis.cause, hypothesis.stream) == ("mirrored", "depth")


@pytest.mark.parametrize("factor", [4.0, 0.25])
def test_scale_of_depth_follows_from_the_flow_of_the_way(factor: float) -> None:
    """Any factor, of which flow of turning is independent."""
    hypothesis = most_probable_cause(
        clean().with_rows(path_depth=clean().rows_by_key["path/depth"] * np.float32(factor))
    )
    assert (hypothesis.cause, hypothesis.stream) == ("unit_mm_m", "depth")
    assert hypothesis.magnitude == pytest.approx(factor, rel=1e-3)


@pytest.mark.parametrize("exponent", [1, -1])
def test_ray_length_is_told_from_depth(exponent: int) -> None:
    """Depth along the ray instead of the axis is named, and so is z that was taken for it and divided."""
    columns, rows = np.meshgrid(np.arange(192), np.arange(144))
    stretch = np.sqrt(1 + ((columns - K[0, 2]) / K[0, 0]) ** 2 + ((rows - K[1, 2]) / K[1, 1]) ** 2)
    depth = (clean().rows_by_key["path/depth"] * stretch**exponent).astype(np.float32)
    hypothesis = most_probable_cause(clean().with_rows(path_depth=depth))
    assert (hypothesis.cause, hypothesis.stream) == ("depth_ray_not_z", "depth")


POSE_FAULTS = {
    "order": ([3, 0, 1, 2], [1, 1, 1, 1], "quaternion_order"),
    "inverse": ([0, 1, 2, 3], [-1, -1, -1, 1], "quaternion_inverted"),
}


@pytest.mark.parametrize(("order", "signs", "cause"), POSE_FAULTS.values(), ids=POSE_FAULTS)
def test_quaternion_convention_is_named(order: list[int], signs: list[int], cause: str) -> None:
    """Undoing another order or direction of the quaternion makes flow agree."""
    orientations = clean().rows_by_key["path/pose/orientation"][:, order] * signs
    hypothesis = most_probable_cause(clean().with_rows(path_pose_orientation=orientations))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "pose")


def test_single_pixel_is_found_and_placed() -> None:
    """At full density one pixel that is off by 0.01 px in one field is an alarm, at its place."""
    flow = clean().rows_by_key["path/flow/25hz"].copy()
    flow[3, 50, 70, 0] += 0.01
    result = judged(FlowGeometryEndpoint(), clean().with_rows(path_flow_25hz=flow))
    place = next(a.finding.where for a in result.alarms if a.finding.code.endswith("worst_pixel"))
    assert (place.stream, place.index_start, place.frame, place.pixel) == ("flow/25hz", 3, 6, (70, 50))


def test_flow_from_the_noisy_pose_is_named() -> None:
    """Declared noise that flow knows nothing of is expected; a flow that follows the noise is an alarm."""
    world = noisy()
    exact = world.rows_by_key | dict(zip(
        ("path/pose/position", "path/pose/orientation"),
        (make_world((50,)).rows_by_key[key] for key in ("path/pose/position", "path/pose/orientation")),
        strict=True,
    ))  # fmt: skip
    hypothesis = most_probable_cause(replace(world, rows_by_key=exact))
    assert (hypothesis.cause, hypothesis.stream) == ("flow_from_noisy_pose", "flow")


def test_noise_that_is_larger_than_declared_is_measured() -> None:
    """Twice the declared noise shows in the size of the corrections, not in what remains."""
    world = noisy().declaring(pose=PoseModel(NOISE.position_sigma_m / 2, NOISE.rotation_sigma_rad / 2))
    result = judged(FlowGeometryEndpoint(), world)
    assert {alarm.finding.code for alarm in result.alarms} == {"flow_geometry.endpoint.pose_correction"}
    hypothesis = first_hypothesis(result, world)
    assert (hypothesis.cause, hypothesis.unit) == ("noise_misdeclared", "percent")
    assert hypothesis.magnitude == pytest.approx(-50, abs=15)


def test_what_cannot_be_asked_or_seen_is_said() -> None:
    """A moving scene and a missing camera are not applicable; intervals off the frames are not observable."""
    check = FlowGeometryEndpoint()
    assert "scene" in check.not_applicable(clean().declaring(flow_model="scene").facts)
    assert "depth camera" in check.not_applicable(clean().declaring(cameras={}).facts)
    facts = clean().facts
    clocks = {
        name: replace(c, times_ns=c.times_ns + 3, ends_ns=c.ends_ns + 3) if c.ends_ns is not None else c
        for name, c in facts.clocks.items()
    }
    observation = observe(check, replace(clean(), facts=replace(facts, clocks=clocks)))
    assert "no frame" in observation.unobservable


def test_undeclared_noise_weakens_the_check() -> None:
    """Without declared pose noise any rigid correction is allowed, and a notice says so; a gain is still found."""
    world = clean().without("flow/10hz").declaring(pose=None)
    assert judged(FlowGeometryEndpoint(), world).result.outcome == "warned"
    assert judged(FlowGeometryEndpoint(), world.with_flow(lambda _, flow: flow * 1.05)).result.outcome == "failed"


def test_empty_fields_do_not_crash() -> None:
    """Fields without a single value say that they share too few pixels with the depth."""
    empty = clean().with_flow(lambda _, flow: np.full_like(flow, np.nan))
    assert "too few" in observe(FlowGeometryEndpoint(), empty).unobservable


def from_the_middle_on(key: str, change: object) -> FlowWorld:
    """A world whose poses are changed between 90 and 250 ms: fields begin and end inside, outside, and across."""
    times_ns = clean().facts.clocks["pose"].times_ns
    part = (times_ns >= 90_000_000) & (times_ns < 250_000_000)
    rows = clean().rows_by_key[key].copy()
    rows[part] = change(rows[part])  # type: ignore[operator]
    return clean().with_rows(**{key.replace("/", "_"): rows})


PARTS_OF_THE_POSE = {
    "inverse": ("path/pose/orientation", lambda q: q * (-1, -1, -1, 1), "quaternion_inverted"),
    "wxyz": ("path/pose/orientation", lambda q: q[:, [3, 0, 1, 2]], "quaternion_order"),
    "y, x, z": ("path/pose/position", lambda p: p[:, [1, 0, 2]], "axes_swapped"),
}


@pytest.mark.parametrize(("key", "change", "cause"), PARTS_OF_THE_POSE.values(), ids=PARTS_OF_THE_POSE)
def test_poses_that_are_wrong_for_a_while_are_named(key: str, change: object, cause: str) -> None:
    """Fields across the fault's edges, whose recomputed flow is garbage, do not make the flow look shifted in time."""
    world = from_the_middle_on(key, change)
    for alarm in judged(FlowGeometryEndpoint(), world).alarms:
        hypotheses = hypotheses_of(alarm, world.facts)
        assert (hypotheses[0].cause, hypotheses[0].stream) == (cause, "pose")
        assert not any(hypothesis.cause == "flow_gain" and hypothesis.support > 0.9 for hypothesis in hypotheses)


def test_poses_far_away_for_a_while_are_poses() -> None:
    """Where half a kilometre makes the recomputed flow absurd, poses are named: no exchange of fields, no gain."""
    world = from_the_middle_on("path/pose/position", lambda p: p + 500.0)
    for alarm in judged(FlowGeometryEndpoint(), world).alarms:
        first = hypotheses_of(alarm, world.facts)[0]
        assert (first.cause, first.stream) == ("teleport", "pose")
        assert first.magnitude == pytest.approx(500.0 * np.sqrt(3), rel=0.01)


def test_flow_of_zeros_is_a_gain() -> None:
    """No flow at all is a gain of -100%."""
    hypothesis = most_probable_cause(clean().with_flow(lambda _, flow: 0 * flow))
    assert (hypothesis.cause, hypothesis.magnitude) == ("flow_gain", pytest.approx(-100.0))


def test_depth_of_another_scene_is_told_by_the_lines_that_flow_keeps_to() -> None:
    """Flow that follows the poses' epipolar lines and not the depth blames the depth's sequence, and no size of it."""
    rng = np.random.default_rng(3)
    steps_m = rng.uniform(0.5, 2.0, (6, 8)).repeat(24, axis=0).repeat(24, axis=1)
    depth = (clean().rows_by_key["path/depth"] * steps_m).astype(np.float32)
    hypothesis = most_probable_cause(clean().with_rows(path_depth=depth))
    assert (hypothesis.cause, hypothesis.stream) == ("other_sequence", "depth")


def test_poses_of_another_flight_are_no_noise() -> None:
    """What they ask for adds up from field to field: poses or flow are another sequence's, and noise is not named."""
    positions_m = clean().rows_by_key["path/pose/position"]
    times_s = np.linspace(0.0, 1.0, len(positions_m))
    aside = positions_m + 0.3 * np.sin(3 * times_s)[:, None] * [1.0, -0.5, 0.4]
    turned = Rotation.from_quat(clean().rows_by_key["path/pose/orientation"]) * Rotation.from_rotvec(
        np.outer(times_s, [0, 0.2, 0])
    )
    world = clean().with_rows(path_pose_position=aside, path_pose_orientation=turned.as_quat())
    alarm = judged(FlowGeometryEndpoint(), world).alarms[0]
    causes = [(hypothesis.cause, hypothesis.stream) for hypothesis in hypotheses_of(alarm, world.facts)]
    assert causes[0][0] == "other_sequence"
    assert ("other_sequence", "pose") in causes
    assert ("noise_misdeclared", "pose") not in causes


@pytest.mark.parametrize(("drift_rad", "least", "most"), [(0.0, 0.5, 1.0), (0.01, 0.0, 0.05)], ids=["noise", "motion"])
def test_corrections_of_noise_cancel_from_field_to_field(drift_rad: float, least: float, most: float) -> None:
    """Differences of white noise are noise however many there are; a turn that all fields share is none."""
    noise = np.random.default_rng(1).normal(0.0, 0.002, (41, 6))
    twists = np.diff(noise, axis=0) + drift_rad
    field = FieldError(Interval("flow/50hz", 0, 0, 1), 0, 1, 1.0, 1.0, 1.0, 1.0, (0, 0))
    fields = [replace(field, free_twist=tuple(twist)) for twist in twists]
    assert least <= noise_likeness(correction_growth(fields)) <= most


def test_flow_of_another_scene_for_a_while_is_of_another_sequence() -> None:
    """Neither a transform nor another motion through the depth of the file gives it; a wrong sign for a while does."""
    columns, rows = pixel_grid()
    foreign_px = np.stack([3 * np.sin(rows / 9), 2 * np.cos(columns / 7)], axis=-1)

    def for_a_while(change: np.ndarray | int) -> FlowWorld:
        def changed(_: str, flow: np.ndarray) -> np.ndarray:
            fields = flow.copy()
            first, last = len(flow) // 2, len(flow) // 2 + max(len(flow) // 5, 1)
            for i in range(first, last):
                # No field repeats another.
                fields[i] = np.roll(change, 5 * i, axis=0) if isinstance(change, np.ndarray) else change * flow[i]
            return fields

        return clean().with_flow(changed)

    for world, cause in ((for_a_while(foreign_px), "other_sequence"), (for_a_while(-1), "flow_sign")):
        (hypothesis, *_) = sorted(
            (h for alarm in judged(FlowGeometryEndpoint(), world).alarms for h in hypotheses_of(alarm, world.facts)
             if h.stream == "flow"),
            key=lambda h: -h.support,
        )  # fmt: skip
        assert hypothesis.cause == cause


@pytest.mark.parametrize("rotation_deg", [(25.0, -40.0, 10.0), (0.0, 0.0, 90.0), (150.0, 20.0, -30.0)])
def test_a_mounting_that_is_turned_far_is_computed_from_the_motion_of_flow(
    rotation_deg: tuple[float, float, float],
) -> None:
    """The rotation vector and the way of the camera, in its axes and in those of the body, state the mounting."""
    T_declared = T_BODY_CAMERA.copy()
    T_declared[:3, :3] = T_BODY_CAMERA[:3, :3] @ Rotation.from_rotvec(rotation_deg, degrees=True).as_matrix()
    world = with_camera(clean(), T=T_declared)
    (alarm, *_) = judged(FlowGeometryEndpoint(), world).alarms
    turned = [
        feature
        for feature in alarm.statistic.features
        if isinstance(feature, ConventionTrial) and feature.transform == "turned_mounting"
    ]
    best = max(turned, key=lambda trial: trial.removed_share)
    assert best.removed_share > 0.999
    np.testing.assert_allclose(best.components, rotation_deg, atol=0.01)
    assert abs(best.magnitude or 0.0) == pytest.approx(np.linalg.norm(rotation_deg), abs=0.01)
    hypothesis = most_probable_cause(world)
    assert (hypothesis.cause, hypothesis.stream) == ("extrinsic_rotation", "metadata")


def test_a_path_of_another_length_states_no_mounting() -> None:
    """Where depths are twice as far, the way by flow is twice that of the poses: no rotation makes them one."""
    world = clean().with_rows(path_depth=clean().rows_by_key["path/depth"] * 2)
    features = judged(FlowGeometryEndpoint(), world).alarms[0].statistic.features
    assert not any(isinstance(f, ConventionTrial) and f.transform == "turned_mounting" for f in features)
