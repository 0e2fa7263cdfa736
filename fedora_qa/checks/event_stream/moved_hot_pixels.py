"""Hot pixels where others are declared: what moved the events moved these as well."""

from collections.abc import Iterator, Sequence
from typing import Final

from fedora_qa.checks.protocol import Suspect

Pixel = tuple[int, int]
"""Column and row."""

_MOST: Final = 0.5
"""Share of the pixels found that must lie where declared ones were moved to; others may be hot besides."""

_FEWEST_SHIFTED: Final = 2
"""One pixel tells no shift: some declared pixel lies beside it in any case. Where two do by chance, of f found and d
declared pixels among n, has the probability f^2 d^2 / 2n or less: 3% for five of five in the smallest sensors."""

_SURE: Final = 0.97


def suspects_of_moved(found: Sequence[Pixel], declared: Sequence[Pixel], size: tuple[int, int]) -> tuple[Suspect, ...]:
    """Return what moves declared hot pixels to where some were found, that which moves most; nothing where little does.

    Parameters
    ----------
    found
        Pixels that fire without cause, and are not declared.
    declared
        Declared hot pixels.
    size
        Width and height of the sensor.
    """
    if not found or not declared:
        return ()
    where = set(found)
    scored = [(len(where & moved), suspect) for moved, suspect, fewest in _moves(found, declared, size)
              if len(where & moved) >= max(fewest, _MOST * len(where))]  # fmt: skip
    return (max(scored, key=lambda one: one[0])[1],) if scored else ()


def _moves(
    found: Sequence[Pixel], declared: Sequence[Pixel], size: tuple[int, int]
) -> Iterator[tuple[set[Pixel], Suspect, int]]:
    """Yield where each move takes the declared pixels, its cause, and how many pixels tell it."""
    right, bottom = size[0] - 1, size[1] - 1
    mirrored, swapped = Suspect("mirrored", "events", _SURE), Suspect("axes_swapped", "events", _SURE)
    yield {(right - column, row) for column, row in declared}, mirrored, 1
    yield {(column, bottom - row) for column, row in declared}, mirrored, 1
    yield {(right - column, bottom - row) for column, row in declared}, mirrored, 1
    yield {(row, column) for column, row in declared}, swapped, 1
    for right_px, down_px in sorted({(x - column, y - row) for x, y in found for column, row in declared}):
        moved = {(column + right_px, row + down_px) for column, row in declared}
        shift = float(right_px) if down_px == 0 else None
        yield moved, Suspect("spatial_offset", "events", _SURE, shift, "px"), _FEWEST_SHIFTED
