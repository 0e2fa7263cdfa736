"""What undoing a proposed fault changed in the findings of a file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from fedora_qa.checks.protocol import Observation
from fedora_qa.faults.reversible import ReversibleFault

HALF: Final = 0.5
"""Part of a deviation that a fault leaves at most where undoing it reduces the deviation."""


@dataclass(frozen=True, slots=True)
class DeviationChange:
    """A deviation without and with a fault undone, in the same windows.

    Attributes
    ----------
    check, name, unit
        The check, and name and unit of its measurement.
    before, after
        Value less expected value, 0 on a side that does not count; NaN where the check no longer states it.
    limit_before, limit_after
        Largest deviation of a correct file.
    """

    check: str
    name: str
    unit: str
    before: float
    limit_before: float
    after: float
    limit_after: float


@dataclass(frozen=True, slots=True)
class UndoTrial:
    """A proposed fault that was undone, and the findings of the plain run under it.

    Attributes
    ----------
    fault
        With the fitted size that was undone.
    description
        What undoing it does, in words.
    cleared
        Ids of findings that are within strict limits with the fault undone.
    left
        Ids of findings that still exceed their limits, with the ratio of the deviation to that without the trial,
        negative where its sign has changed. A finding that is neither cleared nor left was not decided.
    caused
        Codes that exceed their limits only with the fault undone; of a fault that fails, only those of checks with
        findings.
    windows
        Number of windows that were measured.
    crashed
        Checks that failed themselves under it.
    size
        Size of the cause that the trials fitted, in its unit; None: the one that was proposed.
    cleared_alone
        Of ``cleared``, where other faults were undone, too: what clears with them in place, as trials of rivals had
        them; else empty.
    deviations
        Of the findings that are cleared or left.
    observations
        Of the checks of these findings, without and with the fault undone, in the same windows.
    """

    fault: ReversibleFault
    description: str
    cleared: frozenset[str]
    left: Mapping[str, float]
    caused: tuple[str, ...]
    windows: int
    crashed: tuple[str, ...] = ()
    size: float | None = None
    cleared_alone: frozenset[str] = frozenset()
    deviations: tuple[DeviationChange, ...] = ()
    observations: Mapping[str, tuple[Observation, Observation]] = field(default_factory=dict)

    @property
    def succeeds(self) -> bool:
        """Whether undoing the fault clears findings, and causes none."""
        return bool(self.cleared) and not self.caused and not self.crashed

    @property
    def fails(self) -> bool:
        """Whether undoing the fault clears nothing, and leaves more than half of each deviation that is shown.

        Where no deviation can be judged after it, it fails if it brings about others.
        """
        if self.cleared:
            return False
        return min(map(abs, self.left.values())) > HALF if self.left else bool(self.caused)

    @property
    def reduces(self) -> bool:
        """Whether undoing the fault clears findings, or leaves at most half of a deviation."""
        return self.is_decided and not self.fails

    @property
    def is_decided(self) -> bool:
        """Whether the windows show any finding, cleared or left."""
        return bool(self.cleared or self.left)

    def decides(self, findings: Iterable[str]) -> bool:
        """Whether any of some findings is cleared or left."""
        return any(finding in self.cleared or finding in self.left for finding in findings)

    @property
    def balance(self) -> tuple[int, float]:
        """Findings cleared less those caused, 0 where none is cleared; and the mean ratio of what is left, negative."""
        ratios = [min(abs(ratio), 1.0) for ratio in self.left.values()]
        net = len(self.cleared) - len(self.caused) - len(self.crashed) if self.cleared else 0
        return net, -sum(ratios) / max(len(ratios), 1)
