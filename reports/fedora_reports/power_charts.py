"""Detection against size as the geometry of small drawings, in the box of ``charts``: 1000 by 100, stretched."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

from fedora_qa.record.power_tables import curve_words, share_words
from fedora_qa.record.power_types import Curve, Detection, StatedLimit
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.scales import Axis, Tick

_ALMOST_SURE = 0.95


@dataclass(frozen=True, slots=True)
class PowerChart:
    """Detection of one cause against its size: curve, its band, and what was found of the faults by size."""

    title: str
    caption: str
    curve: str
    band: str
    dots: str
    whiskers: str
    level: float
    ticks: tuple[Tick, ...]
    across: str
    alt: str


def detection_chart(detection: Detection) -> PowerChart | None:
    """Draw how a cause is found; None where it has no size, or one size only."""
    if len({part.least for part in detection.tried}) < 2:
        return None
    axis = Axis(detection.tried[0].least, detection.tried[-1].most, logarithmic=True)
    places = [(axis.share(sqrt(part.least * part.most)) * WIDTH, part.found) for part in detection.tried]
    limit = f"; 95% at {curve_words(detection.curve, detection.unit)}" if detection.curve.points else ""
    caption = f"{share_words(detection.found)} found{limit}"
    return PowerChart(
        title=detection.cause,
        caption=caption,
        curve=curve_path(detection.curve, axis),
        band=band_path(detection.curve, axis),
        dots="".join(f"M{x:.1f} {_height(share.value or 0.0):.1f}h0" for x, share in places),
        whiskers="".join(f"M{x:.1f} {_height(share.low):.1f}V{_height(share.high):.1f}" for x, share in places),
        level=_height(_ALMOST_SURE),
        ticks=axis.ticks(4),
        across=f"size in {detection.unit}" if detection.unit not in {"", "1"} else "size",
        alt=f"Detection of {detection.cause} against size: {caption}",
    )


def curve_path(curve: Curve, axis: Axis) -> str:
    """Return the fitted curve as a line; empty where there is none."""
    return _path([(axis.share(point.magnitude) * WIDTH, _height(point.probability)) for point in curve.points])


def band_path(curve: Curve, axis: Axis) -> str:
    """Return the band around the curve as one outline: its upper side, and back along its lower one."""
    xs = [axis.share(point.magnitude) * WIDTH for point in curve.points]
    upper = list(zip(xs, (_height(point.high) for point in curve.points), strict=True))
    lower = list(zip(xs, (_height(point.low) for point in curve.points), strict=True))
    outline = _path(upper + lower[::-1])
    return f"{outline}Z" if outline else ""


@dataclass(frozen=True, slots=True)
class LimitsChart:
    """Where 95% are found, in units of what each check states: a dot and a line a pair, one on another."""

    path: str
    dots: str
    height: int
    fair: tuple[float, float]
    ticks: tuple[Tick, ...]
    alt: str


def limits_chart(stated: Sequence[StatedLimit]) -> LimitsChart | None:
    """Draw the pairs whose curve could be fitted, the boldest limit at the top; None where there are none."""
    bounded = [(limit.curve.at_95.value, limit) for limit in stated if limit.curve.at_95.value is not None]
    if not bounded:
        return None
    bounded.sort(key=lambda pair: -pair[0])
    bounds = [
        bound for value, limit in bounded for bound in (value, limit.curve.at_95.low, limit.curve.at_95.high) if bound
    ]
    axis = Axis(min(0.25, *bounds), max(2.0, *bounds), logarithmic=True)
    rows = [(10 * k + 5, axis.share(value) * WIDTH, limit.curve.at_95) for k, (value, limit) in enumerate(bounded)]
    return LimitsChart(
        path="".join(
            f"M{axis.share(at.low or axis.low) * WIDTH:.1f} {y}H{axis.share(at.high or axis.high) * WIDTH:.1f}"
            for y, _, at in rows
        ),
        dots="".join(f"M{x:.1f} {y}h0" for y, x, _ in rows),
        height=10 * len(rows),
        fair=(axis.share(0.5) * WIDTH, axis.share(1.0) * WIDTH),
        ticks=axis.ticks(),
        alt=f"Size found 95% of the time, in units of the stated limit, of {len(bounded)} pairs of cause and check",
    )


def _height(probability: float) -> float:
    return HEIGHT * (1 - probability)


def _path(places: Sequence[tuple[float, float]]) -> str:
    return "".join(f"{'L' if k else 'M'}{x:.1f} {y:.1f}" for k, (x, y) in enumerate(places))
