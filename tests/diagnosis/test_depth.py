"""Hypotheses for alarms of depth: its range, its scale, its projection, and pairs of frames that disagree."""

from typing import Final, get_args

import numpy as np
import pytest

from fedora_qa.checks.depth.consistency import MotionCorrections, PairsOff
from fedora_qa.checks.depth.parameters import ResidualReduction
from fedora_qa.checks.depth.range import DepthExtent
from fedora_qa.checks.depth.scale import PathScale
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.record.types import Where
from fedora_qa.views.depth_conventions import DepthTrial, Extent, PairTrials, Transform
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposals import named, proposed

RANGE_M: Final = (0.1, 100.0)
NO_CAUSE_OF_ITS_OWN: Final = 0.02
"""Support of whatever makes depth frames and poses contradict each other."""


def trial(transform: Transform, reduction: float = 1.0, parameter: float = 0.0, extent: Extent = "all") -> DepthTrial:
    return DepthTrial(transform, extent, reduction, parameter)


def of_pairs(*pairs: PairTrials, off: int = 1, compared: int = 3, repeated: int = 0) -> tuple[Hypothesis, ...]:
    """The hypotheses for pairs that are off, those that any misfit of depth and pose has left out."""
    hypotheses = proposed("depth.consistency.frame", PairsOff(off, compared, repeated), *pairs, stream="depth")
    return tuple(h for h in hypotheses if h.support not in (0.0, NO_CAUSE_OF_ITS_OWN))


def test_values_on_an_end_of_the_range_are_codes() -> None:
    clipped = Hypothesis("invalid_encoding", "depth", 0.95)
    for rule in ("near_end", "far_end"):
        assert proposed(f"depth.range.{rule}", stream="depth") == (clipped,)


@pytest.mark.parametrize(("nearest_m", "farthest_m", "factor"), [(500.0, 3e4, 1e3), (1e-3, 0.05, 1e-3)])
def test_a_unit_that_brings_both_ends_into_the_range_is_named(
    nearest_m: float, farthest_m: float, factor: float
) -> None:
    """Depths are too large, or too small, by its factor."""
    extent = DepthExtent(nearest_m, farthest_m, RANGE_M)
    assert proposed("depth.range.farthest", extent, stream="depth") == (
        Hypothesis("unit_mm_m", "depth", 0.9, factor, "1"),
    )


def test_values_beyond_the_range_in_any_unit_are_codes_rather() -> None:
    hypotheses = proposed("depth.range.farthest", DepthExtent(0.5, 2e4, RANGE_M), stream="depth")
    assert hypotheses == (
        Hypothesis("invalid_encoding", "depth", 0.5),
        Hypothesis("depth_ray_not_z", "depth", 0.3),
        Hypothesis("unit_mm_m", "depth", 0.3),
    )


@pytest.mark.parametrize(
    ("plausible", "path_factor", "of_depth", "of_pose"),
    [
        pytest.param(True, 1e-3, 0.5, 0.9, id="depths in their range"),
        pytest.param(True, None, 0.5, 0.9, id="path that was not fitted"),
        pytest.param(False, 1e-3, 0.95, 0.3, id="depths out of their range"),
        pytest.param(True, -1e-3, 0.95, 0.3, id="path that would be reversed"),
    ],
)
def test_a_scale_is_that_of_depths_or_of_the_path(
    plausible: bool, path_factor: float | None, of_depth: float, of_pose: float
) -> None:
    """Each has its fitted factor, a path without one that of true depths, and the share of the residual it removes."""
    features = PathScale(path_factor, depths_plausible=plausible), ResidualReduction(0.5)
    hypotheses = proposed("depth.scale.factor", *features, stream="depth", value=1e3, expected=1.0)
    assert hypotheses[:2] == (
        Hypothesis("unit_mm_m", "depth", 0.5 * of_depth, 1e3, "1", 0.01),
        Hypothesis("unit_mm_m", "pose", 0.5 * of_pose, path_factor or 1e-3, "1"),
    )
    assert {hypothesis.support for hypothesis in hypotheses[2:]} == {NO_CAUSE_OF_ITS_OWN}


def test_no_unit_gives_depths_another_sign() -> None:
    features = PathScale(1e-3, depths_plausible=True), ResidualReduction(0.5)
    hypotheses = proposed("depth.scale.factor", *features, stream="depth", value=-1.0)
    assert max(hypothesis.support for hypothesis in hypotheses[:2]) == 0.0


def test_lengths_of_rays_have_the_share_that_they_remove() -> None:
    hypotheses = proposed("depth.projection.ray", ResidualReduction(0.8), stream="depth")
    assert hypotheses[0] == Hypothesis("depth_ray_not_z", "depth", 0.95 * 0.8)
    assert {hypothesis.support for hypothesis in hypotheses[1:]} == {NO_CAUSE_OF_ITS_OWN}


CAUSES_OF_TRANSFORM: Final[dict[Transform, tuple[Hypothesis, ...]]] = {
    "depth_scale": (
        Hypothesis("unit_mm_m", "depth", 1.0, 4.0, "1"),
        Hypothesis("unit_mm_m", "pose", 0.95, 0.25, "1"),
    ),
    "ray_length": (Hypothesis("depth_ray_not_z", "depth", 1.0),),
    "mirrored": (Hypothesis("mirrored", "depth", 1.0),),
    "image_shift": (
        Hypothesis("spatial_offset", "depth", 1.0, 4.0, "px"),
        Hypothesis("intrinsics_centre", "metadata", 0.95, -4.0, "px"),
    ),
    "focal_length": (Hypothesis("intrinsics_focal", "metadata", 1.0, -400.0, "percent"),),
    "frame_order": (Hypothesis("swapped_frames", "depth", 1.0, 4.0, "samples"),),
    "clock_offset": (
        Hypothesis("time_offset", "depth", 1.0, 4.0, "ms"),
        Hypothesis("time_offset", "pose", 0.95, -4.0, "ms"),
    ),
    "conjugate_quaternion": (Hypothesis("quaternion_inverted", "pose", 1.0),),
    "scalar_first_quaternion": (Hypothesis("quaternion_order", "pose", 1.0),),
    "exchanged_axes": (Hypothesis("axes_swapped", "pose", 1.0),),
    "north_east_down": (Hypothesis("frame_convention", "pose", 1.0),),
    "mounting": (Hypothesis("frame_convention", "metadata", 1.0),),
    "free_motion": (
        Hypothesis("teleport", "pose", 0.95, 4.0, "m"),
        Hypothesis("frozen_frames", "pose", 0.9),
        Hypothesis(ANY_CAUSE, "pose", 0.9 * 0.95),
    ),
}


@pytest.mark.parametrize("transform", get_args(Transform))
def test_a_transform_names_the_faults_that_it_undoes(transform: Transform) -> None:
    """With their sizes: the parameter of the transform, in the unit and with the sign of each fault."""
    assert of_pairs(PairTrials(0, (trial(transform, parameter=4.0),))) == CAUSES_OF_TRANSFORM[transform]


def test_frames_that_repeat_deviate_because_they_do() -> None:
    """Other causes have the share of the pairs that do not repeat."""
    shift = PairTrials(0, (trial("image_shift", parameter=4.0),))
    frozen, *others = of_pairs(shift, off=10, compared=10, repeated=4)
    assert frozen == Hypothesis("frozen_frames", "depth", 1.0, 4.0, "samples", 0.0)
    offset = next(h for h in others if h.cause == "spatial_offset")
    assert offset.support == pytest.approx(0.6)


def test_a_cause_must_explain_every_pair_and_has_the_size_of_the_best() -> None:
    """Its support is the mean over pairs, of the best trial on each."""
    first = PairTrials(0, (trial("clock_offset", 0.5, 7.0), trial("clock_offset", 0.6, 9.0)))
    second = PairTrials(1, (trial("clock_offset", 1.0, 10.0),))
    offset = of_pairs(first, second, off=2, compared=6)[0]
    assert (offset.cause, offset.stream, offset.magnitude, offset.unit) == ("time_offset", "depth", 10.0, "ms")
    assert offset.support == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("off", "exchanged", "mirrored"),
    [
        pytest.param(1, 1.0, 0.5, id="few pairs"),
        pytest.param(5, 1.0, 1.0, id="some pairs"),
        pytest.param(9, 0.3, 1.0, id="most pairs"),
    ],
)
def test_single_frames_spoil_few_pairs_and_other_faults_most(off: int, exchanged: float, mirrored: float) -> None:
    """An extent that speaks against a cause halves its support; frames in another order are left for a trial."""
    hypotheses = of_pairs(PairTrials(0, (trial("frame_order", 1.0, 1.0), trial("mirrored"))), off=off, compared=10)
    supports = {hypothesis.cause: hypothesis.support for hypothesis in hypotheses}
    assert (supports.get("swapped_frames", 0.0), supports.get("mirrored", 0.0)) == tuple(
        value if value >= 0.6 or off == 9 else 0.0 for value in (exchanged, mirrored)
    )


@pytest.mark.parametrize(("last", "lasts"), [(10, True), (12, False), (7, False)], ids=["run", "apart", "few"])
def test_pairs_next_to_each_other_have_a_fault_that_lasts(last: int, lasts: bool) -> None:
    """More of them than exchanged frames affect; one frame of the pair at either end of the time has the fault."""
    where = Where(stream="depth", index_start=4, index_stop=last + 1)
    ray, order = trial("ray_length"), trial("frame_order", 0.9, 1.0)
    pairs = PairTrials(4, (trial("ray_length", 0.9, extent="part"),)), PairTrials(6, (ray, order))
    hypotheses = proposed(
        "depth.consistency.frame", PairsOff(last - 4 if lasts else 3, 50, 0), *pairs, stream="depth", where=where
    )
    named_first = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (named_first.cause == "depth_ray_not_z" and named_first.support == pytest.approx(0.95)) is lasts


@pytest.mark.parametrize(
    ("reduced", "last", "is_other"),
    [
        pytest.param(0.9, 10, True, id="six pairs"),
        pytest.param(0.9, 7, True, id="three pairs"),
        pytest.param(0.9, 6, False, id="pairs of one frame"),
        pytest.param(0.99, 10, False, id="explained"),
        pytest.param(0.99, 7, False, id="three pairs explained"),
        pytest.param(0.9, 30, False, id="apart"),
    ],
)
def test_pairs_next_to_each_other_that_nothing_explains_are_of_another_sequence(
    reduced: float, last: int, *, is_other: bool
) -> None:
    """A transform that is the cause leaves rounding alone; pairs that lie apart have faults of single frames."""
    where = Where(stream="depth", index_start=4, index_stop=last + 1)
    pairs = PairTrials(4, (trial("image_shift", reduced, -76.0),))
    hypotheses = proposed("depth.consistency.frame", PairsOff(6, 50, 0), pairs, stream="depth", where=where)
    other = [h for h in hypotheses if h.cause == "other_sequence" and h.support > NO_CAUSE_OF_ITS_OWN]
    assert [(h.stream, h.magnitude, h.unit) for h in other] == [("depth", 12.0, "percent")] * is_other


@pytest.mark.parametrize(("periods", "last", "sizes"), [(-2.0, 4, [2.0]), (0.2, 4, []), (-2.0, 2, [])])
def test_frames_of_a_part_that_are_late_by_whole_frames_may_be_a_ring(
    periods: float, last: int, sizes: list[float]
) -> None:
    """That holds two frames at least; a delay is likelier."""
    facts = facts_of(memory_sequence())
    period_ms = float(np.median(np.diff(facts.clocks["depth"].times_ns))) / NS_PER_MS
    where = Where(stream="depth", index_start=1, index_stop=last + 1)
    pairs = PairTrials(1, (trial("clock_offset", 1.0, periods * period_ms),))
    features = PairsOff(last - 1, 6, 0), pairs
    hypotheses = proposed("depth.consistency.frame", *features, stream="depth", where=where, facts=facts)
    (delay,) = (h for h in hypotheses if (h.cause, h.stream) == ("time_offset", "depth"))
    ring = [h for h in hypotheses if h.cause == "swapped_frames" and h.support > NO_CAUSE_OF_ITS_OWN]
    assert [h.magnitude for h in ring] == sizes
    assert all(h.support == 0.5 * delay.support for h in ring)


def test_a_part_of_the_image_is_a_fault_of_depth() -> None:
    """Pose and camera are common to all pixels; no extent over the pairs speaks against a part."""
    trials = tuple(trial(transform, 0.9, 2.0, extent="part") for transform in ("image_shift", "depth_scale"))
    hypotheses = of_pairs(PairTrials(0, trials), off=1, compared=100)
    assert hypotheses == (
        Hypothesis("spatial_offset", "depth", 0.9, 2.0, "px"),
        Hypothesis("unit_mm_m", "depth", 0.9, 2.0, "1"),
    )


def test_no_part_of_an_image_is_mirrored_or_of_rays() -> None:
    """Both alter all pixels: where a part deviates, they resemble what is wrong there."""
    trials = tuple(trial(transform, 0.9, extent="part") for transform in ("mirrored", "ray_length"))
    assert of_pairs(PairTrials(0, trials), off=1, compared=100) == ()


def test_frames_that_repeat_are_counted() -> None:
    assert of_pairs(PairTrials(0, ()), repeated=2) == (Hypothesis("frozen_frames", "depth", 1.0, 2.0, "samples", 0.0),)


def test_without_a_pair_that_is_off_nothing_is_named() -> None:
    assert proposed("depth.consistency.frame", PairsOff(0, 5, 0), stream="depth") == ()


@pytest.mark.parametrize("removed", [0.9, 0.1])
def test_where_most_pairs_are_off_frames_may_be_of_another_sequence(removed: float) -> None:
    """A free motion explains as much of such pairs as of one wrong pose; 0.3 is left where it explains little."""
    hypotheses = of_pairs(PairTrials(0, (trial("free_motion", removed),)), off=9, compared=10)
    supports = {(h.cause, h.stream): h.support for h in hypotheses}
    assert named(hypotheses)[:2] == [("other_sequence", "depth"), ("other_sequence", "pose")]
    assert supports["other_sequence", "depth"] == supports["other_sequence", "pose"]
    assert supports["other_sequence", "depth"] == pytest.approx(max(0.3, 0.8 * 0.95 * removed))


def test_causes_that_are_named_are_not_repeated_as_a_misfit() -> None:
    """All others that make depth and poses contradict each other have little support."""
    pairs = PairTrials(0, (trial("mirrored"),))
    hypotheses = proposed("depth.consistency.frame", PairsOff(1, 3, 0), pairs, stream="depth")
    assert named(hypotheses).count(("mirrored", "depth")) == 1
    assert len(set(named(hypotheses))) == len(hypotheses)


@pytest.mark.parametrize(
    ("rule", "first", "supports"),
    [("pose_correction", True, (0.8, 0.9 * 0.8)), ("worst_pose_correction", False, (0.4, 0.9 * 0.8))],
)
def test_corrections_of_the_motion_are_noise_that_was_misdeclared(
    rule: str, first: bool, supports: tuple[float, float]
) -> None:
    """Four times the declared variance is a sigma declared 50% too small; of one worst pair that comes last."""
    features = PairsOff(0, 5, 0), MotionCorrections(4.0)
    hypotheses = proposed(f"depth.consistency.{rule}", *features, stream="depth")
    noise, any_pose = hypotheses if first else hypotheses[::-1]
    assert noise == Hypothesis("noise_misdeclared", "pose", supports[0], -50.0, "percent")
    assert any_pose == Hypothesis(ANY_CAUSE, "pose", supports[1])
