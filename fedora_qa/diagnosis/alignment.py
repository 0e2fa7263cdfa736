"""Hypotheses of a shifted or mirrored camera, where the images of two cameras do not coincide.

One shift of one camera explains the shifts of all pairs of cameras.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from fedora_qa.checks.alignment.edge_shifts import CameraPairShift, EventEdges
from fedora_qa.diagnosis.declared_intrinsics import hypotheses_of_centres
from fedora_qa.diagnosis.event_response import offset_hypotheses
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.diagnosis.measured_sizes import length_with_error
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts

_LEAST_SUPPORT: Final = 0.3
"""Cameras whose shift explains less than this are not proposed."""

_LEAST_ERROR_PX: Final = 1e-3
"""Least standard error of a shift, px: without it a pair with an error of 0 px would decide alone."""


def propose_depth(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for ``alignment.depth``: a mirrored camera, or a shifted one."""
    if alarm.finding.code == "alignment.depth.mirrored":
        # Events decide between depth and colour: where their edges lie at the steps of depth, depth is correct.
        events_at_steps = any(edges.significant for edges in alarm.statistic.features if isinstance(edges, EventEdges))
        if "events" not in facts.streams or "events" not in facts.declared.cameras:
            depth = rgb = support("alignment.mirrored_without_events")
        elif events_at_steps:
            depth, rgb = support("alignment.mirrored_depth_with_events"), support("alignment.mirrored_rgb_with_events")
        else:
            depth, rgb = support("alignment.mirrored_depth_against_events"), support("alignment.mirrored_rgb_unopposed")
        return Hypothesis("mirrored", "depth", depth), Hypothesis("mirrored", "rgb", rgb)
    return (
        *hypotheses_of_centres(facts),
        *shift_hypotheses(_pairs(alarm), facts.declared.cameras),
        # An offset or an exchange of frames moves edges along the motion of the image.
        Hypothesis("time_offset", "rgb", support("alignment.frame_time_offset")),
        Hypothesis("time_offset", "depth", support("alignment.frame_time_offset")),
        Hypothesis("swapped_frames", "rgb", support("alignment.swapped_frames")),
        Hypothesis("swapped_frames", "depth", support("alignment.swapped_frames")),
    )


def propose_events(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for ``alignment.events``: a shifted camera, a late stream, another lens or K."""
    if alarm.finding.code == "alignment.events.lens":
        return (
            Hypothesis("rectification_misdeclared", "metadata", support("alignment.event_lens")),
            Hypothesis("intrinsics_focal", "metadata", support("alignment.event_focal_length")),
        )
    if alarm.finding.code == "alignment.events.outward":
        return (
            Hypothesis("intrinsics_focal", "metadata", support("alignment.event_focal_length_outwards")),
            Hypothesis("rectification_misdeclared", "metadata", support("alignment.event_lens_outwards")),
            Hypothesis("time_offset", "events", support("alignment.event_time_offset_outwards")),
        )
    if alarm.finding.code == "alignment.events.time_offset":
        return offset_hypotheses(alarm.statistic.value, alarm.statistic.standard_error, facts)
    return (
        *hypotheses_of_centres(facts),
        *shift_hypotheses(_pairs(alarm), facts.declared.cameras),
        # Offsets and rate errors of clocks shift events along the motion of the image.
        Hypothesis("time_offset", "events", support("alignment.event_time_offset")),
        Hypothesis("time_offset", "rgb", support("alignment.event_time_offset")),
        Hypothesis("clock_rate", "events", support("alignment.event_clock_rate")),
    )


def _pairs(alarm: Alarm) -> list[CameraPairShift]:
    return [feature for feature in alarm.statistic.features if isinstance(feature, CameraPairShift)]


def shift_hypotheses(pairs: Sequence[CameraPairShift], cameras: Mapping[str, Camera]) -> tuple[Hypothesis, ...]:
    """Return a shift of each camera, supported by the share of all pairs' shifts (squared errors) that it explains.

    Parameters
    ----------
    pairs
        Measured shifts of pairs of cameras, px.
    cameras
        Declared cameras by name. The ratio of focal lengths converts pixels of one camera into pixels of another.

    Returns
    -------
    tuple
        Best supported first; sizes in pixels of the shifted camera: lengths, with the sign of the larger component.
    """
    focal_px = {name: float(camera.K[0, 0]) for name, camera in cameras.items()}
    names = dict.fromkeys(name for pair in pairs for name in (pair.second, pair.first))
    hypotheses = []
    for name in names:
        # How far each pair's shift moves when the image of this camera is shifted by 1 px of its own.
        gains = [
            1.0 if name == pair.second else -focal_px[pair.second] / focal_px[pair.first] if name == pair.first else 0.0
            for pair in pairs
        ]
        hypotheses.append(_fitted_shift("spatial_offset", name, support("alignment.spatial_offset"), gains, pairs))
    # The centre of each camera moves by the same number of its own pixels, the image of the second one back.
    differences = [1.0 - focal_px[pair.second] / focal_px[pair.first] for pair in pairs]
    # With equal focal lengths a common move of all centres shifts no pair: it is not identifiable.
    if any(abs(difference) > 1e-6 for difference in differences):
        centre, gains = support("alignment.intrinsics_centre"), [-difference for difference in differences]
        hypotheses.append(_fitted_shift("intrinsics_centre", "metadata", centre, gains, pairs))
    supported = [hypothesis for hypothesis in hypotheses if hypothesis.support >= _LEAST_SUPPORT]
    return tuple(sorted(supported, key=lambda hypothesis: -hypothesis.support))


def _fitted_shift(
    cause: str, stream: str, prior: float, gains: Sequence[float], pairs: Sequence[CameraPairShift]
) -> Hypothesis:
    """Fit one shift to all pairs by weighted least squares; its support is the explained share of the squares."""
    # Weights 1 / sigma^2; the floor keeps a pair with an error of 0 from an infinite weight.
    precisions = np.array([1.0 / np.maximum(pair.error_px, _LEAST_ERROR_PX) ** 2 for pair in pairs])
    shifts_px = np.array([pair.shift_px for pair in pairs])
    gain = np.array(gains)[:, np.newaxis]
    # Normal equations of one unknown an axis: information * fit = projection.
    information = (precisions * gain**2).sum(axis=0)
    projection = (precisions * gain * shifts_px).sum(axis=0)
    fit_px = np.divide(projection, information, out=np.zeros(2), where=information > 0)
    total = float((precisions * shifts_px**2).sum())
    # At the least-squares fit sum(w s^2) = fit * projection + rest: this is the explained share of the squares.
    explained = float((projection * fit_px).sum()) / total if total > 0 else 0.0
    # The error of a component is 1 / sqrt(information).
    if not np.all(information > 0):
        return Hypothesis(cause, stream, prior * explained, 0.0, "px")
    size_px, error_px = length_with_error(fit_px.tolist(), (information**-0.5).tolist())
    return Hypothesis(cause, stream, prior * explained, size_px, "px", error_px)
