"""The plot of docs/trade.md: share of faults found against cost."""

import math
from collections.abc import Sequence
from html import escape
from typing import Final

from tests.benchmarks.trade.measured import Cost, Found, Reach, mean_cost, mean_reach
from tests.benchmarks.trade.traded import BUDGETS, EFFORTS, TIMES_LIMIT

WIDTH: Final = 640
HEIGHT: Final = 300
LEFT: Final = 60
TOP: Final = 20
RIGHT: Final = 90
BOTTOM: Final = 50


def chart(costs: Sequence[Cost], reached: Sequence[Reach], found: Sequence[Found]) -> str:
    """Draw the share of faults found against the ratio of checking to reading, a line for each size of fault.

    Efforts are dots on full lines, budgets rings on broken ones.
    """
    of_efforts = [(effort, mean_cost(costs, effort).ratio) for effort in EFFORTS]
    of_budgets = [(budget, mean_reach(reached, budget).ratio) for budget in BUDGETS]
    ratios = [ratio for _, ratio in of_efforts + of_budgets]
    low, high = math.log10(min(ratios) / 2), math.log10(max(ratios) * 2)

    def place(ratio: float, share: float) -> tuple[float, float]:
        across = (math.log10(ratio) - low) / (high - low)
        return LEFT + across * (WIDTH - LEFT - RIGHT), TOP + (1.0 - share) * (HEIGHT - TOP - BOTTOM)

    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = place(ratios[0], share)[1]
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" class="grid"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{share:.0%}</text>')
    for effort, ratio in of_efforts:
        x = place(ratio, 0.0)[0]
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - 30}" text-anchor="middle">{effort}</text>')
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - 14}" text-anchor="middle">{ratio:.1f} x reading</text>')
    ends: dict[float, tuple[float, float]] = {}
    for index, times in enumerate(TIMES_LIMIT):
        of = [one for one in found if one.times_limit == times]

        def points(looks: Sequence[tuple[str, float]], of: Sequence[Found] = of) -> list[tuple[float, float]]:
            return [place(ratio, sum(one.seen[name] for one in of) / len(of)) for name, ratio in looks]

        dots, rings = points(of_efforts), points(of_budgets)
        parts.append(f'<polyline points="{_joined(dots)}" class="size{index}"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" class="size{index}"/>' for x, y in dots]
        parts.append(f'<path d="M{_joined(rings)}" class="budget size{index}"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" class="budget size{index}"/>' for x, y in rings]
        ends[times] = max(dots[-1], rings[-1])
    below = -math.inf
    for times, (x, y) in sorted(ends.items(), key=lambda end: end[1][1]):
        below = max(y + 4, below + 14)
        parts.append(f'<text x="{x + 10:.1f}" y="{below:.1f}">{times:g} x limit</text>')
    title = escape("Share of faults found against the cost of each effort (dots) and budget (rings)")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">\n<title>{title}</title>\n'
        f"{_STYLE}\n" + "\n".join(parts) + "\n</svg>\n"
    )


def _joined(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


_STYLE: Final = """<style>
text { font: 12px system-ui, sans-serif; fill: #222 } .grid { stroke: #ccc } polyline { fill: none; stroke-width: 2 }
.size0 { stroke: #b8621b; fill: #b8621b } .size1 { stroke: #3b6ea5; fill: #3b6ea5 }
.size2 { stroke: #3d7d4c; fill: #3d7d4c } polyline.size0, polyline.size1, polyline.size2 { fill: none }
.budget.size0, .budget.size1, .budget.size2 { fill: none } path.budget { stroke-width: 1.5; stroke-dasharray: 4 3 }
@media (prefers-color-scheme: dark) { text { fill: #ddd } .grid { stroke: #444 } }
</style>"""
