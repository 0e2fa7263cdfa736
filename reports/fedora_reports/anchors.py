"""Identifiers of places on the page, made of numbers only: nothing that a file holds gets into them."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Anchors:
    """Identifiers within the section of one file."""

    file: int

    @property
    def top(self) -> str:
        """The section of the file."""
        return f"file-{self.file}"

    def part(self, name: str) -> str:
        """Return the identifier of a part with a fixed name."""
        return f"{self.top}-{name}"

    def moment(self, place: int) -> str:
        """Return the identifier of a moment by its place."""
        return f"{self.top}-moment-{place}"

    def finding(self, place: int) -> str:
        """Return the identifier of a finding by its place among all."""
        return f"{self.top}-finding-{place}"

    def diagnosis(self, place: int) -> str:
        """Return the identifier of a diagnosis by its place."""
        return f"{self.top}-cause-{place}"

    def check(self, place: int) -> str:
        """Return the identifier of a check by its place among the results."""
        return f"{self.top}-check-{place}"
