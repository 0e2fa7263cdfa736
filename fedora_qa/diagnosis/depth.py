"""Hypotheses for alarms of depth: the range of values, and the agreement of depth frames with each other and the pose.

Depth and pose contradict each other where either is wrong. So most alarms also name, with little support, causes for
which other checks have stronger evidence.
"""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np

from fedora_qa.causes import CAUSES
from fedora_qa.checks.depth.consistency import MotionCorrections, PairsOff
from fedora_qa.checks.depth.parameters import ResidualReduction
from fedora_qa.checks.depth.range import RANGE_ROUNDING, DepthExtent
from fedora_qa.checks.depth.scale import PathScale
from fedora_qa.checks.integrity.finite import BESIDE_RANGE
from fedora_qa.conventions import MM_PER_M, NS_PER_MS
from fedora_qa.diagnosis.hypothesis import (
    ANY_CAUSE,
    Hypothesis,
    most_probable,
    only_feature,
    support,
    support_of_extent,
    weakened,
)
from fedora_qa.faults.fault import RowRange
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.depth_conventions import Extent, PairTrials, Transform

Size = Callable[[float], float | None]
"""The parameter of a transform -> the size of the fault in the unit of its cause; None where it has no size."""

_MISFIT_CAUSES: Final = {
    "depth": (
        "unit_mm_m", "depth_ray_not_z", "mirrored", "spatial_offset", "frozen_frames", "swapped_frames", "time_offset",
        "clock_rate", "quantised_time", "quantised_values", "time_unit", "unsorted", "other_sequence",
    ),
    "pose": (
        "unit_mm_m", "quaternion_order", "quaternion_inverted", "quaternion_not_unit", "axes_swapped",
        "frame_convention", "frozen_frames", "time_offset", "clock_rate", "quantised_time", "time_unit", "unsorted",
        "teleport", "interpolated_pose", "noise_misdeclared", "lever_arm", "other_sequence", "dropped_samples",
        "duplicated_samples", "quantised_values",
    ),
    "metadata": ("intrinsics_focal", "intrinsics_centre", "extrinsic_rotation", "lever_arm", "frame_convention"),
}  # fmt: skip

_ANY_MISFIT: Final = tuple(
    Hypothesis(cause, stream, support("depth.any_misfit"))
    for stream, causes in _MISFIT_CAUSES.items()
    for cause in causes
)
"""All causes of a contradiction between depth frames and poses."""


def _no_size(_: float) -> None:
    return None


_ALL_OF_IT: Final = 1.0
"""Support of a cause that alone has the effect of the transform."""

_EXACT: Final = 0.98
"""Share of the deviation of a pair from which a transform is all of it, as of fields of flow."""

_OF_WHOLE_IMAGES: Final = frozenset({"mirrored", "depth_ray_not_z"})
"""Causes that alter all pixels of an image: where a part of it deviates, the transform resembles another cause."""

_PAIRS_OF_SINGLE_FRAMES: Final = 3
"""Most pairs next to each other that a fault of single frames affects: two exchanged neighbours are in three."""

_PAIRS_OF_A_FRAME: Final = 2
"""Pairs next to each other that one wrong frame, or one wrong pose, is in."""

_CAUSES_OF_TRANSFORM: Final[Mapping[Transform, tuple[tuple[str, str, float, Size], ...]]] = MappingProxyType({
    "depth_scale": (
        ("unit_mm_m", "depth", _ALL_OF_IT, float),
        ("unit_mm_m", "pose", support("depth.seen_by_other_streams"), lambda factor: 1 / factor if factor else None),
    ),
    "ray_length": (("depth_ray_not_z", "depth", _ALL_OF_IT, _no_size),),
    "mirrored": (("mirrored", "depth", _ALL_OF_IT, _no_size),),
    "image_shift": (
        ("spatial_offset", "depth", _ALL_OF_IT, float),
        ("intrinsics_centre", "metadata", support("depth.seen_by_other_streams"), lambda shift_px: -shift_px),
    ),
    "focal_length": (("intrinsics_focal", "metadata", _ALL_OF_IT, lambda relative_change: -100 * relative_change),),
    "frame_order": (("swapped_frames", "depth", _ALL_OF_IT, float),),
    "clock_offset": (
        ("time_offset", "depth", _ALL_OF_IT, float),
        ("time_offset", "pose", support("depth.seen_by_other_streams"), lambda offset_ms: -offset_ms),
    ),
    "conjugate_quaternion": (("quaternion_inverted", "pose", _ALL_OF_IT, _no_size),),
    "scalar_first_quaternion": (("quaternion_order", "pose", _ALL_OF_IT, _no_size),),
    "exchanged_axes": (("axes_swapped", "pose", _ALL_OF_IT, _no_size),),
    "north_east_down": (("frame_convention", "pose", _ALL_OF_IT, _no_size),),
    "mounting": (("frame_convention", "metadata", _ALL_OF_IT, _no_size),),
    "free_motion": (
        ("teleport", "pose", support("depth.single_pose"), float),
        ("frozen_frames", "pose", support("depth.frozen_pose"), _no_size),
    ),
})  # fmt: skip
"""Causes that a transform undoes: cause, stream, support for a transform that removes everything, and size."""


def propose_range(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for ``depth.range``: a unit with which both ends lie in the range, or codes."""
    if alarm.finding.code.endswith("_end"):
        return (Hypothesis("invalid_encoding", "depth", support("depth.clipped_values")),)
    extent = only_feature(alarm.statistic.features, DepthExtent)
    low_m, high_m = extent.range_m
    # Stored depth is true depth times the factor: dividing undoes the unit before the range is tested.
    for factor in (1 / MM_PER_M, MM_PER_M):
        nearest_m, farthest_m = extent.nearest_m / factor, extent.farthest_m / factor
        if low_m <= nearest_m * (1 + RANGE_ROUNDING) and farthest_m * (1 - RANGE_ROUNDING) <= high_m:
            return (Hypothesis("unit_mm_m", "depth", support("depth.unit_that_fits_range"), factor, "1"),)
    # Codes lie far from depths.
    is_beside = extent.nearest_m >= low_m / BESIDE_RANGE and extent.farthest_m <= BESIDE_RANGE * high_m
    return (
        Hypothesis(
            "invalid_encoding",
            "depth",
            support("depth.codes_beside_range" if is_beside else "depth.codes_beyond_range"),
        ),
        Hypothesis("depth_ray_not_z", "depth", support("depth.rays_beyond_range")),
        Hypothesis("unit_mm_m", "depth", support("depth.unit_beyond_range")),
    )


def propose_scale(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for ``depth.scale``: depths or positions in another unit."""
    statistic, path_scale = alarm.statistic, only_feature(alarm.statistic.features, PathScale)
    # No change of unit gives lengths another sign.
    reduction = only_feature(alarm.statistic.features, ResidualReduction).share if statistic.value > 0 else 0.0
    # Where only a reversed path fits the depths, the unit of the positions is not the cause.
    path_reversed = path_scale.factor is not None and path_scale.factor <= 0
    if path_scale.depths_plausible and not path_reversed:
        of_depth, of_pose = support("depth.scale_of_plausible_depths"), support("depth.scale_of_path")
    else:
        of_depth, of_pose = support("depth.scale_of_implausible_depths"), support("depth.scale_of_unlikely_path")
    # Where no fit measures the factor of the positions, true depths make it the inverse of that of the depths.
    of_positions = 1.0 / statistic.value if path_scale.factor is None and statistic.value > 0 else path_scale.factor
    return (
        Hypothesis("unit_mm_m", "depth", of_depth * reduction, statistic.value, "1", statistic.standard_error),
        Hypothesis("unit_mm_m", "pose", of_pose * reduction, of_positions, "1"),
        *_ANY_MISFIT,
    )


def propose_projection(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for ``depth.projection``: ray lengths in place of z-depth."""
    reduction = only_feature(alarm.statistic.features, ResidualReduction).share
    return (Hypothesis("depth_ray_not_z", "depth", support("depth.ray_exponent") * reduction), *_ANY_MISFIT)


def propose_consistency(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for ``depth.consistency``: transforms that remove the deviation, or misdeclared noise."""
    of_pairs = _with_ring(_of_pairs(alarm), alarm, facts)
    if alarm.finding.code not in ("depth.consistency.pose_correction", "depth.consistency.worst_pose_correction"):
        return of_pairs
    ratio = only_feature(alarm.statistic.features, MotionCorrections).variance_ratio
    # The ratio is of variances, measured over declared: declared over measured sigma, less 1, is the size of the cause.
    percent = 100 * (1 / ratio**0.5 - 1) if ratio else None
    of_all, of_worst = (
        Hypothesis("noise_misdeclared", "pose", support(f"depth.{name}"), percent, "percent")
        for name in ("noise_of_all_pairs", "noise_of_worst_pair")
    )
    any_pose = Hypothesis(ANY_CAUSE, "pose", support("depth.any_pose") * of_all.support)
    if alarm.finding.code == "depth.consistency.pose_correction":
        return (of_all, any_pose, *of_pairs)
    return (*of_pairs, any_pose, of_worst)


def _with_ring(hypotheses: tuple[Hypothesis, ...], alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Add a ring buffer of frames that was read from its middle to a delay of a part by whole frames.

    All frames of such a ring but those at its seam are late, or early, by the same number of frames.
    """
    clock, part = facts.clocks.get("depth"), frames_between(alarm)
    delay = next((h for h in hypotheses if (h.cause, h.stream) == ("time_offset", "depth")), None)
    if clock is None or part is None or delay is None or not delay.magnitude:
        return hypotheses
    steps_ns = np.diff(clock.times_ns[clock.advancing])
    frames = abs(round(NS_PER_MS * delay.magnitude / float(np.median(steps_ns)))) if len(steps_ns) else 0
    strength = support("depth.ring_of_frames") * delay.support
    if not frames or any(h.cause == "swapped_frames" and h.support >= strength for h in hypotheses):
        return hypotheses
    ring = Hypothesis("swapped_frames", "depth", strength, float(frames), "samples")
    return (*(h for h in hypotheses if h.cause != "swapped_frames"), ring)


def _of_pairs(alarm: Alarm) -> tuple[Hypothesis, ...]:
    """Return the causes whose undoing lets the pairs agree, best supported first, then causes of other checks."""
    pairs = only_feature(alarm.statistic.features, PairsOff)
    if not pairs.off:
        return ()
    trials = [feature for feature in alarm.statistic.features if isinstance(feature, PairTrials)]
    # A fault that begins between the frames of the worst pair affects that pair alone, so its share of the file does
    # not count.
    averages = (
        *_by_trials(trials, ("all",), share_off=pairs.off / pairs.compared),
        *_by_trials(trials, ("part",), share_off=1.0),
    )
    follow_each_other = _pairs_in_a_row(alarm, pairs)
    # At either end of the time that a fault holds, one frame of a pair has it.
    of_a_while = _by_trials(trials, ("all", "part"), share_off=pairs.off / pairs.compared, lasts=True)
    if follow_each_other > _PAIRS_OF_SINGLE_FRAMES:
        averages = (*averages, *of_a_while)
    # The best supported, of each cause and stream.
    ascending = sorted(averages, key=lambda hypothesis: hypothesis.support)
    hypotheses = list({(hypothesis.cause, hypothesis.stream): hypothesis for hypothesis in ascending}.values())
    if pairs.repeated:
        # Equal frames deviate because they are equal: what else is fitted to them is the cause of other pairs at most.
        hypotheses = weakened(hypotheses, max(1 - pairs.repeated / pairs.off, 0.0))
        # Frames that are equal bit for bit are counted, not fitted.
        hypotheses.append(Hypothesis("frozen_frames", "depth", _ALL_OF_IT, float(pairs.repeated), "samples", 0.0))
    # A free motion fits any fault of the two poses of a pair: no other fault of the poses explains more.
    single_pose = max((h.support for h in hypotheses if (h.cause, h.stream) == ("teleport", "pose")), default=0.0)
    # Depths or poses of another sequence agree in no pair, so they are ruled out where few pairs deviate.
    if 2 * pairs.off > pairs.compared:
        # In a pair with another sequence, a free motion explains as much as with one wrong pose. The support of one
        # wrong pose is reduced where most pairs deviate: the division reverses this reduction.
        another = support("depth.another_sequence_by_free_motion") / support("convention_trials.unlikely_extent")
        least = support("depth.another_sequence")
        hypotheses += [
            Hypothesis("other_sequence", stream, max(least, another * single_pose)) for stream in ("depth", "pose")
        ]
    elif follow_each_other > _PAIRS_OF_A_FRAME and all(h.support < _EXACT for h in (*hypotheses, *of_a_while)):
        # Nor do any in a part of the file, be it of three pairs: each transform, the exchange of neighbours included,
        # leaves nothing but rounding where it is the cause.
        share_percent = 100 * pairs.off / pairs.compared
        for_a_while = support("depth.another_sequence_for_a_while")
        hypotheses.append(Hypothesis("other_sequence", "depth", for_a_while, share_percent, "percent"))
    named = list(most_probable(hypotheses))
    if 2 * pairs.off > pairs.compared and all(each.cause != "swapped_frames" for each in named):
        # Frames far from their places agree with no transform of two neighbours, until a trial puts them in order.
        named.append(Hypothesis("swapped_frames", "depth", support("depth.frames_in_another_order")))
    causes = {(hypothesis.cause, hypothesis.stream) for hypothesis in named}
    return (
        *named,
        Hypothesis(ANY_CAUSE, "pose", support("depth.any_pose") * single_pose),
        *(hypothesis for hypothesis in _ANY_MISFIT if (hypothesis.cause, hypothesis.stream) not in causes),
    )


def _pairs_in_a_row(alarm: Alarm, pairs: PairsOff) -> int:
    """Return the number of deviating pairs where these lie next to each other in a part of the file; otherwise 0."""
    where = alarm.finding.where
    if where.index_start is None or where.index_stop is None:
        return 0
    between = where.index_stop - where.index_start - 1
    return between if between <= pairs.off < pairs.compared else 0


def frames_between(alarm: Alarm) -> RowRange | None:
    """Return the rows of depth that lie between the first and the last pair that deviates.

    A fault that holds for a while begins within the first of these pairs and ends within the last. None where the
    finding is none of pairs of frames, or where no row lies between.
    """
    where = alarm.finding.where
    is_of_pairs = alarm.finding.code in ("depth.consistency.frame", "depth.consistency.tile")
    if not is_of_pairs or where.index_start is None or where.index_stop is None:
        return None
    first, last = where.index_start + 1, where.index_stop - 1
    return (first, last) if last > first else None


def _by_trials(
    pairs: Sequence[PairTrials], extents: Sequence[Extent], *, share_off: float, lasts: bool = False
) -> list[Hypothesis]:
    """Return the mean support of each cause over the pairs on which its transform was tried.

    ``share_off`` is the share of deviating pairs, ``lasts`` as of ``support_of_extent``.
    """
    by_cause: dict[tuple[str, str], list[tuple[float, float | None]]] = {}
    for pair in pairs:
        # Support of the best trial of each cause and stream on this pair, and the size of the fault.
        best: dict[tuple[str, str], tuple[float, float | None]] = {}
        for trial in pair.trials:
            if trial.extent not in extents:
                continue
            for cause, stream, full_support, size_of in _CAUSES_OF_TRANSFORM[trial.transform]:
                # Pose and camera are common to all pixels: a deviation of a part of the image is a fault of depth.
                if trial.extent == "part" and (stream != "depth" or (cause in _OF_WHOLE_IMAGES and not lasts)):
                    continue
                explained = full_support * trial.residual_reduction
                if (cause, stream) not in best or best[cause, stream][0] < explained:
                    best[cause, stream] = explained, size_of(trial.parameter)
        for key, of_pair in best.items():
            by_cause.setdefault(key, []).append(of_pair)
    hypotheses = []
    for (cause, stream), of_pairs in by_cause.items():
        # A cause must explain every deviating pair, hence the mean. Its size comes from the pair that it explains best:
        # in other pairs further causes may contribute.
        mean_support = float(np.mean([of_pair[0] for of_pair in of_pairs]))
        mean_support *= support_of_extent(cause, share_off, lasts=lasts)
        _, size = max(of_pairs, key=lambda of_pair: of_pair[0])
        unit = "" if size is None else CAUSES[cause].unit
        hypotheses.append(Hypothesis(cause, stream, mean_support, size, unit))
    return hypotheses
