"""The page of efforts counts what was found, and its plot stands where its numbers say."""

import re
import xml.etree.ElementTree as ET

import pytest

from tests.benchmarks.trade.chart import chart
from tests.benchmarks.trade.measured import Cost, Found, Reach, mean_cost, mean_reach
from tests.benchmarks.trade.page import page
from tests.benchmarks.trade.traded import BUDGETS, EFFORTS, SAMPLED, TIMES_LIMIT, TRADED

COSTS = [
    Cost(scene, effort, 2.0, seconds, share * 1e6, share, share / 2, dict.fromkeys(SAMPLED, share), "clean", 3.0)
    for scene in ("park-day", "park-noisy")
    for effort, seconds, share in zip(EFFORTS, (1.0, 4.0, 20.0), (0.05, 0.25, 1.0), strict=True)
]
REACHED = [
    Reach(scene, budget, "quick", windows, 100, reading_s)
    for scene, reading_s in (("park-day", 0.5), ("park-noisy", 1.5))
    for budget, windows in zip(BUDGETS, (4, 10, 30, 100), strict=True)
]


def found(sequences: int) -> list[Found]:
    """At its limit a fault is found by ``full`` alone, at twice it by ``standard`` too, at four times by all efforts.

    No budget but the longest finds any.
    """
    least = dict(zip(EFFORTS, (4.0, 2.0, 1.0), strict=True)) | dict(zip(BUDGETS, (9.0, 9.0, 9.0, 1.0), strict=True))
    return [
        Found(one.name, one.scene, number, times, times * 0.5, one.unit, {look: times >= least[look] for look in least})
        for one in TRADED
        for number in range(sequences)
        for times in TIMES_LIMIT
    ]


def test_costs_add_over_scenes() -> None:
    """Ratios are of sums: a scene that takes long counts for more."""
    cost = mean_cost(COSTS, "full")
    assert (cost.checking_s, cost.reading_s, cost.ratio) == (40.0, 4.0, 10.0)


def test_page_states_shares_with_their_intervals() -> None:
    """All of 48 found: above 92.6%; none: below 7.4% (Clopper and Pearson)."""
    text = "".join(page(COSTS, COSTS[:3], REACHED, found(4)))
    quick, larger, seen = (line for line in text.splitlines() if line.startswith("| quick "))
    assert seen == "| quick | 5% | 5% | 5% | 5% | 2% | 100% |"
    assert larger == "| quick | 0.50 | 5.0% |"
    assert quick == "| quick | 5% | 0.5 | 5.0% | 5% | 0% (0% to 7%) | 0% (0% to 7%) | 100% (93% to 100%) |"
    assert (
        "| park-noisy, imu:time_offset | 0.5 to 0.5 ms | 0/4 | 0/4 | 4/4 | 0/4 | 4/4 | 4/4 | 4/4 | 4/4 | 4/4 |" in text
    )


def test_page_states_what_a_budget_reaches() -> None:
    """Its ratio is to the mean of what reading the scenes takes."""
    assert mean_reach(REACHED, "5s").ratio == 5.0
    text = "".join(page(COSTS, COSTS[:3], REACHED, found(4)))
    assert "| 8s | 8 | 10 of 100 and 10 of 100 | quick | 0% (0% to 7%) | 0% (0% to 7%) | 0% (0% to 7%) |" in text
    assert "| 20s | 20 | 100 of 100 and 100 of 100 | quick | 100% (93% to 100%) |" in text


def test_plot_is_drawn_to_scale() -> None:
    """It is well-formed; a line of nothing found lies on 0%, one of everything on 100%."""
    svg = chart(COSTS, REACHED, found(1))
    ET.fromstring(svg)
    lines = [[float(y) for y in re.findall(r",([\d.]+)", points)] for points in re.findall('points="([^"]*)"', svg)]
    bottom, top = lines[0][0], lines[0][2]
    assert bottom == pytest.approx(250.0)
    assert top == pytest.approx(20.0)
    assert lines == [[bottom, bottom, top], [bottom, top, top], [top, top, top]]
    of_budgets = re.findall('<path d="M([^"]*)" class="budget', svg)
    budgets = [[float(y) for y in re.findall(r",([\d.]+)", points)] for points in of_budgets]
    assert budgets == [[bottom, bottom, bottom, top]] * 3
