"""A measurement drawn on a line: the range that an honest file gives, and where the value lies."""

import math
from dataclasses import dataclass

from fedora_qa.record.types import Measurement

_REACH = 2.0
"""The drawing reaches this many limits to either side of what is expected."""


@dataclass(frozen=True, slots=True)
class Gauge:
    """Places as shares of the drawing's width, 0 to 1.

    Attributes
    ----------
    band
        Left and right end of what an honest file gives.
    value
        Where the value lies; at an end where it lies beyond it.
    error
        Left and right end of one standard error about the value.
    sees
        Where the least deviation lies that would have been seen; None where that is not known, or beyond the drawing.
    beyond
        -1 or 1 where the value lies beyond the drawing's left or right end, else 0.
    counts
        Whether the value lies beyond the limit on a side that counts.
    words
        The same in words.
    """

    band: tuple[float, float]
    value: float
    error: tuple[float, float]
    sees: float | None
    beyond: int
    counts: bool
    words: str


def gauge_of(measurement: Measurement) -> Gauge | None:
    """Return the gauge of a measurement that has a value, an expected value and a limit greater than 0; else None."""
    value, expected, limit = measurement.value, measurement.expected, measurement.limit
    if value is None or expected is None or limit is None or not all(map(math.isfinite, (value, expected, limit))):
        return None
    if limit <= 0:
        return None
    deviation = value / limit - expected / limit
    if not math.isfinite(deviation):
        return None
    error = measurement.standard_error or 0.0
    spread = error / limit if math.isfinite(error) else 0.0
    left = 0.0 if measurement.side == "upper" else _share(-1.0)
    right = 1.0 if measurement.side == "lower" else _share(1.0)
    return Gauge(
        band=(left, right),
        value=_share(deviation),
        error=(_share(deviation - spread), _share(deviation + spread)),
        sees=_sees(measurement, limit),
        beyond=0 if abs(deviation) <= _REACH else int(math.copysign(1, deviation)),
        counts=(deviation > 1 and measurement.side != "lower") or (deviation < -1 and measurement.side != "upper"),
        words=f"{abs(deviation):.3g} of the limit {'above' if deviation >= 0 else 'below'} the expected value",
    )


def _sees(measurement: Measurement, limit: float) -> float | None:
    """Return where the least fault that would have been seen lies, on the side that counts."""
    least = measurement.least_detectable
    if least is None or not math.isfinite(least) or least < limit or least > _REACH * limit:
        return None
    return _share(-least / limit if measurement.side == "lower" else least / limit)


def _share(deviation: float) -> float:
    """Return where a deviation, in limits, lies on the drawing."""
    return min(max((deviation + _REACH) / (2 * _REACH), 0.0), 1.0)
