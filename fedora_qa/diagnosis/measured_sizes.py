"""Sizes of faults that results state: deviations and vectors."""

from collections.abc import Mapping, Sequence
from math import hypot
from typing import Final

import numpy as np

from fedora_qa.checks.images.order import ALLOWED, OutOfOrderIntervals
from fedora_qa.faults.fault import Vector3, signed_length
from fedora_qa.judgement.judge import Alarm
from fedora_qa.layout.canonical import flow_rate_hz, is_flow_stream
from fedora_qa.record.types import Measurement, Result
from fedora_qa.sequence.facts import Facts

_FEWEST_FRAMES: Final = 3
"""Least number of frames for a period."""

_FEWEST_RATES: Final = 2
"""Rates of flow that must state one offset: any number fits one rate."""

_AGREE: Final = 3.0
"""Standard errors within which a rate agrees with the mean of all: one of three rates is outside in 1% of files."""

_HALF_WAY: Final = 0.5
"""Position between R, G, B and another order of channels from which the other one is nearer."""

_SIGNIFICANT: Final = 3.1
"""Standard errors by which noise alone exceeds 0 with a probability of 0.001."""

_MOST: Final = 0.5
"""Share of the changes of a pixel from which most lie on lines between frames."""

MS_PER_PERCENT_OF_S: Final = 10.0

Results = Mapping[str, Result]
"""Results of a file, by check."""


def measured(result: Result | None, name: str) -> Measurement | None:
    """Return a measurement of a result by its name; None where there is none."""
    return None if result is None else next((m for m in result.measurements if m.name == name), None)


def deviation(result: Result | None, name: str, *, beyond_limit: bool = False) -> float:
    """Return the value of a measurement less what is expected, in its unit; 0 where it was not measured.

    With ``beyond_limit`` it is 0 as well where it does not exceed its limit.
    """
    measurement = measured(result, name)
    if measurement is None or measurement.value is None or (beyond_limit and not measurement.exceeds_limit):
        return 0.0
    return measurement.value - (measurement.expected or 0.0)


def is_nearer_to_other_order(results: Results) -> bool:
    """Whether the colours lie nearer to another order of the channels than to R, G, B, apart from bounds of the fit.

    Parameters
    ----------
    results
        Of the file, by check. ``images.channels`` states how far towards each order the colours lie.
    """
    result = results.get("images.channels")
    towards = [m for m in (result.measurements if result else ()) if m.name.startswith("towards_")]
    return any(
        m.value is not None and m.value > _HALF_WAY and m.value > _SIGNIFICANT * (m.standard_error or 0.0)
        for m in towards
    )


def has_lines_of_frames(results: Results) -> bool:
    """Whether changes of a pixel lie on lines between frames more often than in any correct file, material or not.

    Parameters
    ----------
    results
        Of the file, by check, judged by the limits alone.
    """
    lines = measured(results.get("event_response.interpolation"), "lines_between_renders")
    return lines is not None and lines.value is not None and lines.exceeds_limit


def begin_and_end_with_frames(results: Results) -> bool:
    """Whether most changes of a pixel lie on lines that begin and end with the frames.

    The clocks of events and frames then differ by less than a spacing of events: after any larger offset, most
    intervals hold the events of two lines.

    Parameters
    ----------
    results
        Of the file, by check, judged by the limits alone.
    """
    lines = measured(results.get("event_response.interpolation"), "lines_between_renders")
    return has_lines_of_frames(results) and lines is not None and (lines.value or 0.0) > _MOST


def length_with_error(components: Sequence[float], errors: Sequence[float]) -> tuple[float, float]:
    """Return the length of a vector, with the sign of its largest component, and its standard error.

    The error is that of the component along the vector, of independent errors of the components; of a vector of length
    0 the largest of them.
    """
    length = signed_length(tuple(components))
    if not length:
        return 0.0, max(errors)
    # d|v| / dv_i = v_i / |v|.
    return length, hypot(*(value * error / length for value, error in zip(components, errors, strict=True)))


def vector(group: str, result: Result | None) -> Vector3 | None:
    """Return the deviations of ``<group>_x``, ``_y`` and ``_z``; None where they were not measured."""
    if measured(result, f"{group}_x") is None:
        return None
    return deviation(result, f"{group}_x"), deviation(result, f"{group}_y"), deviation(result, f"{group}_z")


def flow_offset_ms(results: Results) -> tuple[float, float] | None:
    """Return the offset of the flow against the frames on which its rates agree, ms, with its standard error.

    The photometric fit of each rate states it in percent of the interval of that rate. Flow of another motion has no
    offset that several rates share.

    Parameters
    ----------
    results
        Of the file, by check.

    Returns
    -------
    tuple or None
        The mean weighted by precision; None where fewer than two rates state an offset, none of them exceeds its limit,
        or they disagree.
    """
    result = results.get("flow_photometric.residual")
    rates = dict.fromkeys(m.name.partition(" ")[0] for m in result.measurements) if result is not None else {}
    offsets_ms, errors_ms, exceeds = [], [], False
    for rate in rates:
        offset = measured(result, f"{rate} time")
        if offset is None or offset.value is None or not offset.standard_error or offset.limit is None:
            continue
        # One percent of an interval of 1 / rate seconds, in ms.
        percent_ms = MS_PER_PERCENT_OF_S / flow_rate_hz(rate)
        offsets_ms.append(percent_ms * offset.value)
        errors_ms.append(percent_ms * offset.standard_error)
        exceeds |= abs(offset.value) > offset.limit
    if len(offsets_ms) < _FEWEST_RATES or not exceeds:
        return None
    weights = 1 / np.square(errors_ms)
    mean_ms = float(np.average(offsets_ms, weights=weights))
    agree = np.all(np.abs(np.array(offsets_ms) - mean_ms) < _AGREE * np.array(errors_ms))
    return (mean_ms, float(1 / np.sqrt(weights.sum()))) if agree else None


def flow_vector(group: str, components: tuple[str, ...], stream: str, results: Results) -> tuple[float, ...]:
    """Return a vector that the photometric fit measures of flow, of the rate with the smallest error.

    Parameters
    ----------
    group, components
        Parts of the measurements' names: ``<rate> <group>_<component>``.
    stream
        Flow, one of its rates, or ``metadata``: an excess of the flow's camera is a lack of the declared one.

    Returns
    -------
    tuple
        One number a component, 0 where none was measured.
    """
    none = (0.0,) * len(components)
    result = results.get("flow_photometric.residual")
    if result is None:
        return none
    fits: list[tuple[float, tuple[float, ...]]] = []
    for rate in dict.fromkeys(m.name.partition(" ")[0] for m in result.measurements):
        fit = [m for c in components if (m := measured(result, f"{rate} {group}_{c}")) is not None]
        if stream in ("metadata", "flow", rate) and len(fit) == len(components):
            error = max(m.standard_error or 0.0 for m in fit)
            fits.append((error, tuple(deviation(result, m.name) for m in fit)))
    sign = -1.0 if stream == "metadata" else 1.0
    return tuple(sign * value for value in min(fits)[1]) if fits else none


def rgb_px_per_event_px(facts: Facts) -> float:
    """Return how many pixels of the colour camera the angle of a pixel of the event camera spans."""
    cameras = facts.declared.cameras
    # A direction moves by f times its tangent in either image.
    return float(cameras["rgb"].K[0, 0] / cameras["events"].K[0, 0]) if {"rgb", "events"} <= cameras.keys() else 1.0


def frames_lost_before(alarm: Alarm, facts: Facts) -> tuple[int, tuple[int, ...]]:
    """Return the colour frame before which frames were lost and the following ones renumbered, and how many were lost.

    Between the frames beside the loss the image moves on by several intervals of the flow, and does not return. Frames
    that are stamped with their number then end early, by the frames that were lost; and the ratio to the flow is their
    number and one, as far as the displacement is measured, which falls behind where it is long.

    Parameters
    ----------
    alarm
        Of ``images.order``.
    facts
        Of the file.

    Returns
    -------
    frame
        The first frame behind the loss; 0 where no frames were lost so.
    counts
        Numbers of lost frames that are possible, likeliest first; empty where no frames were lost so.
    """
    intervals = [feature for feature in alarm.statistic.features if isinstance(feature, OutOfOrderIntervals)]
    clock, frame = facts.clocks.get("rgb"), alarm.finding.where.frame
    if not intervals or clock is None or not frame or len(clock.times_ns) < _FEWEST_FRAMES:
        return 0, ()
    ratios = intervals[0].relative_ratios
    if len(ratios) != 1 or intervals[0].frames_return is not False or ratios[0] < 1 + ALLOWED:
        return 0, ()
    period_ns = float(np.median(np.diff(clock.times_ns)))
    # The last field of flow begins an interval before the end.
    lasts_ns = [
        int(other.times_ns[-1])
        for stream, other in facts.clocks.items()
        if stream != "rgb" and other.usable and not is_flow_stream(stream)
    ]
    if facts.events is not None:
        lasts_ns.append(facts.events.last_ns)
    # Whole periods by which half of the other streams go on.
    missing = round((float(np.median(lasts_ns)) - int(clock.times_ns[-1])) / period_ns) if lasts_ns else 0
    return frame, tuple(dict.fromkeys(count for count in (missing, round(ratios[0]) - 1) if count > 0))
