"""Sets of whole numbers as disjoint intervals, in order."""

from collections.abc import Iterator


class Intervals:
    """Half-open intervals of whole numbers, none of which touch."""

    def __init__(self, *stretches: tuple[int, int]) -> None:
        self._stretches = sorted(stretches)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter(self._stretches)

    def add(self, start: int, stop: int) -> None:
        """Add the numbers from ``start`` up to but without ``stop``."""
        # Touching intervals join as well: a block may fill a gap that several blocks have left.
        touching = [(begin, end) for begin, end in self._stretches if begin <= stop and start <= end]
        apart = [stretch for stretch in self._stretches if stretch not in touching]
        joined = min([start, *(begin for begin, _ in touching)]), max([stop, *(end for _, end in touching)])
        self._stretches = sorted([*apart, joined])

    def remove(self, start: int, stop: int) -> None:
        """Remove the numbers from ``start`` up to but without ``stop``."""
        pieces = (
            piece for begin, end in self._stretches for piece in ((begin, min(end, start)), (max(begin, stop), end))
        )
        self._stretches = [(begin, end) for begin, end in pieces if begin < end]

    def overlap(self, start: int, stop: int) -> int:
        """Return how many of the numbers from ``start`` up to but without ``stop`` are in the set."""
        return sum(max(min(stop, end) - max(start, begin), 0) for begin, end in self._stretches)
