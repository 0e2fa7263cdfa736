"""The part of the images, or of the time, in which a fault holds: the rest agrees, whatever the fault is."""

from collections.abc import Sequence

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.checks.flow_geometry.validity import WrongFlowValues
from fedora_qa.faults.image_part import PixelRegion
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.pixel_lattice import union_of


def part_of_images(alarms: Sequence[Alarm], stream: str) -> PixelRegion | None:
    """Return the rectangle in which flow deviates from that of depth and poses; None where it deviates as a whole.

    Flow begins at the pixels of depth: a fault of either stream has the rectangle of the flow. Where one rate deviates
    as a whole, the fault is one of whole images.

    Parameters
    ----------
    alarms
        Of the file.
    stream
        Of the fault: ``depth``, ``flow`` or one of its rates.
    """
    if stream_family(stream) not in ("flow", "depth"):
        return None
    extents = _extents(alarms, stream)
    parts = [extent.part for extent in extents if extent.part is not None]
    if not parts or len(parts) < len(extents):
        return None
    # Where depth is far or missing, flow deviates by values that are there or not alone.
    of_values = [f.part for alarm in alarms for f in alarm.statistic.features if isinstance(f, WrongFlowValues)]
    return union_of([*parts, *filter(None, of_values)])


def part_of_time(alarms: Sequence[Alarm], stream: str, facts: Facts) -> tuple[int, int] | None:
    """Return the starts of the first and the last field of flow that deviate, ns from the origin.

    None where no rate deviates, where a rate deviates from its first field to its last, or where most fields of a rate
    between them agree: single fields that deviate are no part.

    Parameters
    ----------
    alarms, stream
        As of ``part_of_images``.
    facts
        With the clocks of the rates.
    """
    rates = [rate for rate in facts.flow_streams if stream in ("flow", "depth", rate)]
    # Each rate has several statistics with one extent.
    of_rate = {
        alarm.finding.where.stream: feature
        for alarm in alarms
        for feature in alarm.statistic.features
        if isinstance(feature, FieldsOff) and feature.count and alarm.finding.where.stream in rates
    }
    if not of_rate:
        return None
    first_ns = min(extent.first_ns for extent in of_rate.values())
    last_ns = max(extent.last_ns for extent in of_rate.values())
    is_part = False
    for rate in rates:
        times_ns = facts.clocks[rate].times_ns
        within = int(np.count_nonzero((times_ns >= first_ns) & (times_ns <= last_ns)))
        if rate in of_rate and 2 * of_rate[rate].count <= within:
            return None
        is_part |= within < len(times_ns)
    return (first_ns, last_ns) if is_part else None


def fewest_fields_off(alarms: Sequence[Alarm], stream: str) -> int:
    """Return the number of deviating fields of the rate that has fewest, of those that deviate; 0 without any."""
    return min((extent.count for extent in _extents(alarms, stream)), default=0)


def _extents(alarms: Sequence[Alarm], stream: str) -> list[FieldsOff]:
    return [
        feature
        for alarm in alarms
        if stream_family(stream) == "depth" or stream in ("flow", alarm.finding.where.stream)
        for feature in alarm.statistic.features
        if isinstance(feature, FieldsOff) and feature.count
    ]
