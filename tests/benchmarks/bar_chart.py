"""Bars as a small SVG, in the colours of whoever looks at it."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

WIDTH, ROW, LABEL, VALUE = 640, 22, 230, 90

_STYLE: Final = """<style>
text { font: 12px system-ui, sans-serif; fill: #222 } .group { font-weight: 600 } rect { fill: #3b6ea5 }
@media (prefers-color-scheme: dark) { text { fill: #ddd } rect { fill: #7aa7d9 } }
</style>"""


@dataclass(frozen=True, slots=True)
class Bars:
    """A titled group of bars that share a scale, from 0: names, lengths, and what is written behind each."""

    title: str
    names: Sequence[str]
    values: Sequence[float]
    labels: Sequence[str]


def bar_chart(groups: Sequence[Bars], alt: str) -> str:
    """Draw groups below each other, each with a scale of its own."""
    rows = sum(len(group.values) + 2 for group in groups)
    parts, top = [], 0
    for group in groups:
        parts += _group(group, top)
        top += (len(group.values) + 2) * ROW
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {rows * ROW}" role="img">\n'
        f"<title>{escape(alt)}</title>\n{_STYLE}\n" + "\n".join(parts) + "\n</svg>\n"
    )


def _group(group: Bars, top: int) -> list[str]:
    parts = [f'<text class="group" x="0" y="{top + ROW - 6}">{escape(group.title)}</text>']
    longest = max(group.values)
    for row, (name, value, label) in enumerate(zip(group.names, group.values, group.labels, strict=True), start=1):
        y, length = top + row * ROW, (WIDTH - LABEL - VALUE) * value / longest
        parts.append(f'<text x="{LABEL - 8}" y="{y + ROW - 6}" text-anchor="end">{escape(name)}</text>')
        parts.append(f'<rect x="{LABEL}" y="{y + 3}" width="{length:.1f}" height="{ROW - 6}"/>')
        parts.append(f'<text x="{LABEL + length + 6:.1f}" y="{y + ROW - 6}">{escape(label)}</text>')
    return parts
