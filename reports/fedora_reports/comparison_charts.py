"""Distributions laid over each other, in the box of ``charts``: 1000 by 100, stretched; across is logarithmic."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.comparison.tables import TOLD_WORDS
from fedora_qa.comparison.types import Comparison, Overlay
from fedora_qa.record.wording import number, with_error
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.instants import Array
from fedora_reports.scales import Axis, Tick

MOST_DRAWN: Final = 6
"""More lines than these cannot be told apart."""

_TAIL: Final = 1e-3
"""Share on either end that may lie beyond the axis, so that a few far values do not flatten all others."""


@dataclass(frozen=True, slots=True)
class Line:
    """The distribution of one subject; ``place`` is its place among all, which gives its colour."""

    place: int
    path: str


@dataclass(frozen=True, slots=True)
class OverlayChart:
    """One quantity in every subject. ``distances`` says how far each lies from the first."""

    title: str
    lines: tuple[Line, ...]
    ticks: tuple[Tick, ...]
    aside: str
    distances: tuple[str, ...]
    alt: str


def overlay_chart(overlay: Overlay, comparison: Comparison) -> OverlayChart | None:
    """Draw shares per octave as steps; None where no value above the first bin, which begins at 0, is known."""
    edges = np.array(overlay.edges)
    above = edges[:-1] > 0
    shares_by_place = {
        place: np.array(shares) for place, shares in enumerate(overlay.shares[:MOST_DRAWN]) if shares is not None
    }
    axis = _axis(edges, [shares * above for shares in shares_by_place.values()])
    if axis is None:
        return None
    names = [subject.name for subject in comparison.subjects]
    octaves = np.log2(edges[1:][above] / edges[:-1][above])
    heights = {place: shares[above] / octaves for place, shares in shares_by_place.items()}
    tallest = max(float(height.max()) for height in heights.values())
    lefts = axis.shares(edges[np.append(above, True)]) * WIDTH
    zeros = [
        f"{names[place]} {shares[~above].sum():.1%}"
        for place, shares in shares_by_place.items()
        if shares[~above].any()
    ]
    return OverlayChart(
        title=overlay.meaning,
        lines=tuple(Line(place, _steps(lefts, height / tallest * HEIGHT)) for place, height in heights.items()),
        ticks=axis.ticks(),
        aside=f"At 0, left of the axis: {', '.join(zeros)}." if zeros else "",
        distances=_distances(overlay, comparison),
        alt=f"{overlay.meaning}, of {', '.join(names[place] for place in shares_by_place)}: "
        f"from {number(axis.low)} to {number(axis.high)} {overlay.unit}",
    )


def _axis(edges: Array, shares: list[Array]) -> Axis | None:
    """Return an axis that holds all but the tails of every distribution."""
    ends = []
    for share in shares:
        below = np.cumsum(share)
        if below[-1] > 0:
            first = int(np.searchsorted(below, _TAIL * below[-1], "right"))
            last = int(np.searchsorted(below, (1 - _TAIL) * below[-1]))
            ends.append((float(edges[first]), float(edges[last + 1])))
    if not ends:
        return None
    return Axis(min(low for low, _ in ends), max(high for _, high in ends), logarithmic=True)


def _steps(lefts: Array, heights: Array) -> str:
    """Return an outline of steps without its base; steps beyond the axis, which have no width, are left out."""
    parts: list[str] = []
    for left, right, height in zip(lefts[:-1], lefts[1:], heights, strict=True):
        if right > left:
            parts.append(f"{'L' if parts else 'M'}{left:.1f} {HEIGHT - height:.1f}H{right:.1f}")
    return "".join(parts)


def _distances(overlay: Overlay, comparison: Comparison) -> tuple[str, ...]:
    """Return how far each subject lies from the first, in words."""
    words = []
    for pair in comparison.pairs:
        differences = [difference for difference in pair.differences if difference.quantity == overlay.quantity]
        name = comparison.subjects[pair.after].name
        if len(differences) == 1:
            apart = with_error(differences[0].distance, differences[0].distance_standard_error, differences[0].unit)
            words.append(f"{name}: distance {apart}, {TOLD_WORDS[differences[0].told]}")
        elif differences:
            words.append(f"{name}: {sum(d.told == 'differs' for d in differences)} of {len(differences)} files differ")
    return tuple(words)
