"""Which stretches of a range are meant: disjoint, in order."""

from collections.abc import Iterator


class Intervals:
    """Half-open stretches of whole numbers, none of which touch."""

    def __init__(self, *stretches: tuple[int, int]) -> None:
        self._stretches = sorted(stretches)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter(self._stretches)

    def add(self, start: int, stop: int) -> None:
        """Mean these as well."""
        touching = [(one, end) for one, end in self._stretches if one <= stop and start <= end]
        apart = [stretch for stretch in self._stretches if stretch not in touching]
        joined = min([start, *(one for one, _ in touching)]), max([stop, *(end for _, end in touching)])
        self._stretches = sorted([*apart, joined])

    def remove(self, start: int, stop: int) -> None:
        """Mean these no longer."""
        pieces = (piece for one, end in self._stretches for piece in ((one, min(end, start)), (max(one, stop), end)))
        self._stretches = [(one, end) for one, end in pieces if one < end]

    def overlap(self, start: int, stop: int) -> int:
        """Return how many between these are meant."""
        return sum(max(min(stop, end) - max(start, one), 0) for one, end in self._stretches)
