"""Hypotheses for the alarms of each check: one function a check, in the module of its subject."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fedora_qa.diagnosis import (
    alignment,
    clocks,
    depth,
    event_conservation,
    event_response,
    event_stream,
    flow_events,
    flow_photometric,
    images,
    imu,
    index_maps,
    integrity,
    metadata,
    pose,
)
from fedora_qa.diagnosis.flow_geometry.endpoint import propose_endpoint
from fedora_qa.diagnosis.flow_geometry.validity import propose_validity
from fedora_qa.diagnosis.flow_rates import propose_composition
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Returns the hypotheses for an alarm of one check, best supported first.

It reads the features of the alarm's statistic and the facts of the file, no samples: diagnosis decodes nothing.
"""

PROPOSALS: Final[Mapping[str, Propose]] = MappingProxyType({
    "integrity.layout": integrity.propose_layout,
    "integrity.readable": integrity.propose_readable,
    "integrity.finite": integrity.propose_finite,
    "metadata.complete": metadata.propose_complete,
    "metadata.units": metadata.propose_units,
    "metadata.cameras": metadata.propose_cameras,
    "metadata.profile": metadata.propose_profile,
    "clocks.order": clocks.propose_order,
    "clocks.unit": clocks.propose_unit,
    "clocks.rate": clocks.propose_rate,
    "clocks.gaps": clocks.propose_gaps,
    "clocks.span": clocks.propose_span,
    "clocks.resolution": clocks.propose_resolution,
    "index_maps.rgb": index_maps.propose_frame_to_event,
    "index_maps.depth": index_maps.propose_frame_to_event,
    "event_stream.bounds": event_stream.propose_bounds,
    "event_stream.duplicates": event_stream.propose_duplicates,
    "event_stream.gaps": event_stream.propose_gaps,
    "event_stream.rates": event_stream.propose_rates,
    "event_response.orientation": event_response.propose_orientation,
    "event_response.model": event_response.propose_model,
    "event_response.threshold": event_response.propose_threshold,
    "event_response.timing": event_response.propose_timing,
    "event_response.alignment": event_response.propose_alignment,
    "event_response.frames": event_response.propose_frames,
    "event_response.conservation": event_conservation.propose_conservation,
    "alignment.depth": alignment.propose_depth,
    "alignment.events": alignment.propose_events,
    "flow_photometric.residual": flow_photometric.propose_residual,
    "flow_geometry.endpoint": propose_endpoint,
    "flow_geometry.validity": propose_validity,
    "flow_rates.composition": propose_composition,
    "depth.range": depth.propose_range,
    "depth.consistency": depth.propose_consistency,
    "depth.scale": depth.propose_scale,
    "depth.projection": depth.propose_projection,
    "images.repeats": images.propose_repeats,
    "images.order": images.propose_order,
    "images.exposure": images.propose_exposure,
    "images.channels": images.propose_channels,
    "images.transfer": images.propose_transfer,
    "flow_events.sharpness": flow_events.propose_sharpness,
    "pose.orientation": pose.propose_orientation,
    "pose.continuity": pose.propose_continuity,
    "pose.noise": pose.propose_noise,
    "imu.rotation": imu.propose_rotation,
    "imu.translation": imu.propose_translation,
    "imu.timing": imu.propose_timing,
    "imu.noise": imu.propose_noise,
})  # fmt: skip
"""By the name of the check."""


def propose(alarms: Sequence[Alarm], facts: Facts) -> dict[str, tuple[Hypothesis, ...]]:
    """Return the hypotheses for each alarm of one file, by the id of its finding.

    Parameters
    ----------
    alarms
        Of one file.
    facts
        Of the same file.

    Returns
    -------
    dict[str, tuple[Hypothesis, ...]]
        Best supported first.
    """
    return {alarm.finding.id: hypotheses_of(alarm, facts) for alarm in alarms}


def hypotheses_of(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm, best supported first.

    Parameters
    ----------
    alarm
        Its check has a row in ``PROPOSALS``.
    facts
        Of the same file.

    Returns
    -------
    tuple
        One at least for most checks.
    """
    # The code of a finding is ``<subject>.<property>.<rule>``: without the rule it is the name of the check.
    return PROPOSALS[alarm.finding.code.rpartition(".")[0]](alarm, facts)
