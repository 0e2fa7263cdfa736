"""Bytes and requests of servers."""

from dataclasses import dataclass
from typing import Final, Self


@dataclass(frozen=True, slots=True)
class Traffic:
    """Bytes of files that were transferred, and requests, including those for size and version."""

    transferred_bytes: int = 0
    requests: int = 0

    def __add__(self, other: Self) -> "Traffic":
        return Traffic(self.transferred_bytes + other.transferred_bytes, self.requests + other.requests)

    def __sub__(self, other: Self) -> "Traffic":
        return Traffic(self.transferred_bytes - other.transferred_bytes, self.requests - other.requests)


NO_TRAFFIC: Final = Traffic()
