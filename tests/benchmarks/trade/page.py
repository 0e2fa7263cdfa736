"""Text of docs/trade.md."""

import time
from collections.abc import Iterator, Sequence
from typing import Final

from scipy.stats import binomtest

from tests.benchmarks.trade.measured import Cost, Found, Reach, mean_cost, mean_reach
from tests.benchmarks.trade.traded import BASES, BUDGETS, DURATION_S, EFFORTS, LARGER, SIZE, TIMES_LIMIT, TRADED

CONFIDENCE: Final = 0.95

HEAD: Final = """\
# What each effort costs, and what it detects

Written by `make study-trade`, {date}: {bases} sequences of {duration:g} s and {width}x{height} pixels of each scene.
Each fault is planted at 1, 2 and 4 times the limit that `full` states for that file. It counts as detected if the
check that states the limit detects it. Time is processor time of all checks together, as a ratio to reading the file
once by plain h5py.

![Detection against cost](trade.svg)

| effort | windows measured | time / reading | share of full's time | decoded | at 1x | at 2x | at 4x |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""

LARGER_HEAD: Final = """
IMU, poses, timestamps and the digest are read at every effort, whatever the windows. This is a large part of so small
a file. The same sequence with frames of {width}x{height} takes, again in processor time:

| effort | time / reading | share of full's time |
| --- | --- | --- |
"""

SEEN_HEAD: Final = """
## What is measured of each stream

Share of the rows of a stream that lie in the windows of an effort, and share of their tiles that dense checks measure
in frames of this size.

| effort | {streams} | tiles of frames and flow | timestamps, maps, IMU, poses |
| --- |{rules} --- | --- |
"""

BUDGET_HEAD: Final = """
## Budgets

Budgets are wall-clock time of one process, including two seconds for its start, on a machine without other work. What
a budget reaches was measured with a clean sequence of each scene and all checks. The planted faults were then
measured in the same windows. Another machine may reach more windows, or fewer.

| budget | budget / reading | windows measured | as densely as | at 1x | at 2x | at 4x |
| --- | --- | --- | --- | --- | --- | --- |
"""

FOOT: Final = """
## How the settings were chosen

`full` is the default. It is the only effort whose stated limits rest on every event, sample and frame, and a release
is checked only once.

`quick` is for a first look at a download. Its standard errors grow with the inverse root of the share of windows that
it measures, and few windows give a poor estimate of their own scatter. So it detects a fault of a whole stream from
about four times the limit of `full` on. A fault at a single time may lie between its windows. Timestamps, IMU and
poses are read completely at every effort. In small frames, checks seem slow in comparison with reading: decoding
grows with the number of pixels, but each window has a fixed cost.

The settings of `quick` were chosen from these measurements:

- With 5% of the windows, 5% of the tiles and every fourth flow field, it took half of its present time. But then the
  time offset of events was uncertain by 5.0 ms instead of 0.8 ms, and flow could not be compared with frames.
- A tenth of the windows with every third field detected 75% of the faults of four times the limit (36 of 48).
- 8% of the windows with every field detected 43 of 48. Few fields of a rate have enough texture to be compared, and
  these must not be left out.

So `quick` measures every field, in as many windows as a tenth of the time of `full` allows in frames of a usual size.
Fewer tiles of small frames save no time. How frames are interpolated between pixels, and how many events are used,
was chosen from two other studies: [flow interpolation](flow-interpolation.md) and [event
readings](event-readings.md).

## By fault

Sequences in which the fault was detected, of those for which `full` states a limit.

"""


def page(
    costs: Sequence[Cost], larger: Sequence[Cost], reached: Sequence[Reach], found: Sequence[Found]
) -> Iterator[str]:
    """Text of docs/trade.md; ``larger`` are the costs of a sequence with larger frames."""
    width, height = SIZE
    date = time.strftime("%Y-%m-%d")
    yield HEAD.format(date=date, bases=BASES, duration=DURATION_S, width=width, height=height)
    whole = mean_cost(costs, "full")
    for effort in EFFORTS:
        cost = mean_cost(costs, effort)
        shares = _shares(found, effort)
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
    yield from _seen(costs)
    yield from _budgets(reached, found)
    yield FOOT
    columns = [f"{effort} {times:g}x" for effort in EFFORTS for times in TIMES_LIMIT]
    yield f"| fault | limits of full | {' | '.join(columns)} |\n|{' --- |' * (len(columns) + 2)}\n"
    for traded in TRADED:
        of = [one for one in found if (one.name, one.scene) == (traded.name, traded.scene)]
        cells = [_count(of, effort, times) for effort in EFFORTS for times in TIMES_LIMIT]
        yield f"| {traded.scene}, {traded.name} | {_limits(of)} | {' | '.join(cells)} |\n"


def _seen(costs: Sequence[Cost]) -> Iterator[str]:
    streams = tuple(costs[0].seen)
    yield SEEN_HEAD.format(streams=" | ".join(streams), rules=" --- |" * len(streams))
    for effort in EFFORTS:
        cost = mean_cost(costs, effort)
        shares = " | ".join(f"{cost.seen[stream]:.0%}" for stream in streams)
        yield f"| {effort} | {shares} | {cost.tile_share:.0%} | 100% |\n"


def _budgets(reached: Sequence[Reach], found: Sequence[Found]) -> Iterator[str]:
    yield BUDGET_HEAD
    for budget in BUDGETS:
        of = [reach for reach in reached if reach.budget == budget]
        densities = " and ".join(sorted({reach.density for reach in of}))
        windows = " and ".join(f"{reach.windows} of {reach.of}" for reach in of)
        yield (
            f"| {budget} | {mean_reach(reached, budget).ratio:.0f} | {windows} | {densities} "
            f"| {_shares(found, budget)} |\n"
        )


def _shares(found: Sequence[Found], look: str) -> str:
    """Return the shares of faults of each size that an effort or a budget finds."""
    return " | ".join(_share([one for one in found if one.times_limit == times], look) for times in TIMES_LIMIT)


def _share(of: Sequence[Found], look: str) -> str:
    seen = binomtest(sum(one.seen[look] for one in of), len(of))
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
