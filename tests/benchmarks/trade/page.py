"""Text and plot of docs/trade.md."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

from scipy.stats import binomtest

from tests.benchmarks.trade.traded import BASES, DURATION_S, EFFORTS, LARGER, SIZE, TIMES_LIMIT, TRADED

CONFIDENCE: Final = 0.95

HEAD: Final = """\
# What each effort costs, and what it finds

Written by `make study-trade`, {date}: {bases} sequences of {duration:g} s and {width}x{height} pixels of each scene. A
fault is planted at 1, 2 and 4 times what `full` states as its limit in that file, and sought by the check whose limit
it is. Seconds are of processor time, as a ratio to reading the file once by plain h5py; they are of all checks
together.

![Detection against cost](trade.svg)

| effort | windows seen | time / reading | share of full's time | decoded | at 1x | at 2x | at 4x |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""

LARGER_HEAD: Final = """
What an effort reads whatever the windows (IMU, poses, stamps, the digest) is a large part of so small a file. The same
sequence with frames of {width}x{height}, again by processor time:

| effort | time / reading | share of full's time |
| --- | --- | --- |
"""

FOOT: Final = """
`full` is the default: it is the only effort whose stated limits are of every event, sample and frame, and releases
are checked once. `quick` is for a look at a download. Its standard errors grow with the root of the share of windows
that it sees, and few windows know their own scatter badly, so that a fault of a whole stream is seen from some four
times the limit of `full` on; a fault of an instant may lie between its windows. Stamps, IMU and poses are read whole
at every effort. Small frames make checks look slow beside reading: decoding grows with pixels, the fixed work of a
window does not.

How `quick` was chosen, from this curve: with 5% of the windows, 5% of the tiles and every fourth field, its time was
half of what it is, but events were timed to 5.0 ms instead of 0.8, and flow against frames told nothing. A tenth of the
windows with every third field found 75% of the faults of four times the limit (36 of 48), 8% with every field 43 of 48,
for 12.4% of full's time here and 7.6% at 540x405: of a rate few fields have texture enough to tell anything, and those
must not be missed. So it is every field, of as many windows as a tenth of the time allows in frames of a usual size.
Thinning out the tiles of small frames saves nothing.

## By fault

Sequences in which the fault was found, of those in which `full` states a limit.

"""


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor seconds of reading and of checking one clean file, its verdict, and checks that saw too little."""

    scene: str
    effort: str
    reading_s: float
    checking_s: float
    decoded_bytes: float
    window_share: float
    verdict: str
    blind: float

    @property
    def ratio(self) -> float:
        """Seconds of checking in units of those of reading."""
        return self.checking_s / self.reading_s


@dataclass(frozen=True, slots=True)
class Found:
    """One planted fault, and at which efforts it was found."""

    name: str
    scene: str
    number: int
    times_limit: float
    magnitude: float
    unit: str
    seen: Mapping[str, bool]


def page(costs: Sequence[Cost], larger: Sequence[Cost], found: Sequence[Found]) -> Iterator[str]:
    """Text of docs/trade.md; ``larger`` are the costs of a sequence with larger frames."""
    width, height = SIZE
    date = time.strftime("%Y-%m-%d")
    yield HEAD.format(date=date, bases=BASES, duration=DURATION_S, width=width, height=height)
    whole = mean_cost(costs, "full")
    for effort in EFFORTS:
        cost = mean_cost(costs, effort)
        shares = " | ".join(_share([one for one in found if one.times_limit == times], effort) for times in TIMES_LIMIT)
        yield (
            f"| {effort} | {cost.window_share:.0%} | {cost.ratio:.1f} | {cost.checking_s / whole.checking_s:.1%} | "
            f"{cost.decoded_bytes / whole.decoded_bytes:.0%} | {shares} |\n"
        )
    yield f"\nIntervals are {CONFIDENCE:.0%} (Clopper and Pearson).\n"
    yield LARGER_HEAD.format(width=LARGER[0], height=LARGER[1])
    whole = mean_cost(larger, "full")
    for effort in EFFORTS:
        cost = mean_cost(larger, effort)
        yield f"| {effort} | {cost.ratio:.2f} | {cost.checking_s / whole.checking_s:.1%} |\n"
    yield FOOT
    columns = [f"{effort} {times:g}x" for effort in EFFORTS for times in TIMES_LIMIT]
    yield f"| fault | limits of full | {' | '.join(columns)} |\n|{' --- |' * (len(columns) + 2)}\n"
    for traded in TRADED:
        of = [one for one in found if (one.name, one.scene) == (traded.name, traded.scene)]
        cells = [_count(of, effort, times) for effort in EFFORTS for times in TIMES_LIMIT]
        yield f"| {traded.scene}, {traded.name} | {_limits(of)} | {' | '.join(cells)} |\n"


def mean_cost(costs: Sequence[Cost], effort: str) -> Cost:
    """Sum of the costs of an effort over the scenes; the share of windows is their mean."""
    of = [cost for cost in costs if cost.effort == effort]
    return Cost(
        "all",
        effort,
        sum(cost.reading_s for cost in of),
        sum(cost.checking_s for cost in of),
        sum(cost.decoded_bytes for cost in of),
        sum(cost.window_share for cost in of) / len(of),
        ", ".join(sorted({cost.verdict for cost in of})),
        sum(cost.blind for cost in of),
    )


def chart(costs: Sequence[Cost], found: Sequence[Found]) -> str:
    """Draw the share of faults found against the ratio of checking to reading, a line for each size of fault."""
    ratios = [mean_cost(costs, effort).ratio for effort in EFFORTS]
    low, high = math.log10(min(ratios) / 2), math.log10(max(ratios) * 2)
    width, height, left, top = 640, 300, 60, 20

    def place(ratio: float, share: float) -> tuple[float, float]:
        across = (math.log10(ratio) - low) / (high - low)
        return left + across * (width - left - 90), top + (1.0 - share) * (height - top - 50)

    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = place(ratios[0], share)[1]
        parts.append(f'<path d="M{left} {y:.1f}H{width - 90}" class="grid"/>')
        parts.append(f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{share:.0%}</text>')
    for effort, ratio in zip(EFFORTS, ratios, strict=True):
        x = place(ratio, 0.0)[0]
        parts.append(f'<text x="{x:.1f}" y="{height - 30}" text-anchor="middle">{effort}</text>')
        parts.append(f'<text x="{x:.1f}" y="{height - 14}" text-anchor="middle">{ratio:.1f} x reading</text>')
    ends: dict[float, tuple[float, float]] = {}
    for index, times in enumerate(TIMES_LIMIT):
        of = [one for one in found if one.times_limit == times]
        points = [
            place(ratio, sum(one.seen[effort] for one in of) / len(of))
            for effort, ratio in zip(EFFORTS, ratios, strict=True)
        ]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        parts.append(f'<polyline points="{line}" class="size{index}"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" class="size{index}"/>' for x, y in points]
        ends[times] = points[-1]
    below = -math.inf
    for times, (x, y) in sorted(ends.items(), key=lambda end: end[1][1]):
        below = max(y + 4, below + 14)
        parts.append(f'<text x="{x + 10:.1f}" y="{below:.1f}">{times:g} x limit</text>')
    title = escape("Share of faults found against the cost of each effort")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">\n<title>{title}</title>\n'
        f"{_STYLE}\n" + "\n".join(parts) + "\n</svg>\n"
    )


_STYLE: Final = """<style>
text { font: 12px system-ui, sans-serif; fill: #222 } .grid { stroke: #ccc } polyline { fill: none; stroke-width: 2 }
.size0 { stroke: #b8621b; fill: #b8621b } .size1 { stroke: #3b6ea5; fill: #3b6ea5 }
.size2 { stroke: #3d7d4c; fill: #3d7d4c } polyline.size0, polyline.size1, polyline.size2 { fill: none }
@media (prefers-color-scheme: dark) { text { fill: #ddd } .grid { stroke: #444 } }
</style>"""


def _share(of: Sequence[Found], effort: str) -> str:
    seen = binomtest(sum(one.seen[effort] for one in of), len(of))
    interval = seen.proportion_ci(CONFIDENCE, method="exact")
    return f"{seen.k / seen.n:.0%} ({interval.low:.0%} to {interval.high:.0%})"


def _count(of: Sequence[Found], effort: str, times: float) -> str:
    sized = [one for one in of if one.times_limit == times]
    return f"{sum(one.seen[effort] for one in sized)}/{len(sized)}"


def _limits(of: Sequence[Found]) -> str:
    limits = sorted(one.magnitude for one in of if one.times_limit == 1.0)
    if not limits:
        return "none stated"
    return f"{limits[0]:.2g} to {limits[-1]:.2g} {of[0].unit}"
