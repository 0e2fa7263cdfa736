"""Identifiers of places on the page. They consist of fixed names and numbers, so that no text of a file gets in."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Anchors:
    """Identifiers within the section of one file, which is given by its index."""

    file: int

    @property
    def top(self) -> str:
        """The section of the file."""
        return f"file-{self.file}"

    def part(self, name: str) -> str:
        """Return the identifier of a part with a fixed name."""
        return f"{self.top}-{name}"

    def snapshot(self, index: int) -> str:
        """Return the identifier of a snapshot."""
        return f"{self.top}-moment-{index}"

    def finding(self, index: int) -> str:
        """Return the identifier of a finding by its index among all findings of the file."""
        return f"{self.top}-finding-{index}"

    def diagnosis(self, index: int) -> str:
        """Return the identifier of a diagnosis."""
        return f"{self.top}-cause-{index}"

    def check(self, index: int) -> str:
        """Return the identifier of a check by its index among the results."""
        return f"{self.top}-check-{index}"
