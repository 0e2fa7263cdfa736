"""What the study of full-size files measures, and the ratios that follow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from tests.benchmarks.full_size.machine import Machine
from tests.benchmarks.full_size.measured_run import Run


@dataclass(frozen=True, slots=True)
class Reading:
    """How much plain reading decoded, and what it took into arrays that are kept, and into new ones."""

    decoded_bytes: int
    wall_s: float
    new_arrays_wall_s: float


@dataclass(frozen=True, slots=True)
class Statistic:
    """A check of one file: what it took, seconds by stage and check as its record says, and bytes decoded."""

    run: Run
    seconds: Mapping[str, float]
    decoded_bytes: int


@dataclass(frozen=True, slots=True)
class Turn:
    """What is measured right after one another: the start of a check, plain decoding of a file, and its check."""

    start: Statistic
    reading: Reading
    measured: Statistic

    @property
    def work_s(self) -> float:
        """Time of the check beside its start."""
        return max(self.measured.run.wall_s - self.start.run.wall_s, 0.0)


@dataclass(frozen=True, slots=True)
class OfEffort:
    """The turns of one effort on one file."""

    effort: str
    length_s: float
    turns: Sequence[Turn]

    @property
    def ratio(self) -> float:
        """Median over the turns: one that something else has disturbed does not count."""
        return median(turn.work_s / turn.reading.wall_s for turn in self.turns)

    @property
    def ratio_to_new_arrays(self) -> float:
        """The same, where decoding gives new arrays."""
        return median(turn.work_s / turn.reading.new_arrays_wall_s for turn in self.turns)

    @property
    def fastest(self) -> Statistic:
        """The fastest check: what else the machine does makes it slower, never faster."""
        return min((turn.measured for turn in self.turns), key=lambda one: one.run.wall_s)

    @property
    def start_s(self) -> float:
        """Seconds of the fastest start."""
        return min(turn.start.run.wall_s for turn in self.turns)

    @property
    def work_s(self) -> float:
        """Seconds of the fastest check beside the fastest start."""
        return max(self.fastest.run.wall_s - self.start_s, 0.0)


@dataclass(frozen=True, slots=True)
class OnCluster:
    """Checks of one file on one cluster: the first, for which its workers load all, and the fastest later one."""

    first: Statistic
    later: Statistic


@dataclass(frozen=True, slots=True)
class Selection:
    """One subject alone, and the streams that its checks ask for."""

    subject: str
    needs: tuple[str, ...]
    measured: Statistic


@dataclass(frozen=True, slots=True)
class Study:
    """Everything that was measured. ``fields`` of flow and ``frames`` of colour are in the shortest file."""

    size: tuple[int, int]
    machine: Machine
    efforts: Sequence[OfEffort]
    exhaustive: Statistic
    exhaustive_together: Statistic
    alone: Statistic
    together: Statistic
    on_cluster: OnCluster
    memories: Mapping[str, Statistic]
    selections: Sequence[Selection]
    fields: int
    frames: int

    @property
    def full(self) -> Sequence[OfEffort]:
        """Effort ``full``, the shortest file first."""
        return sorted((one for one in self.efforts if one.effort == "full"), key=lambda one: one.length_s)

    @property
    def readings(self) -> Mapping[float, Reading]:
        """The fastest plain decoding of each file, by its length."""
        found: dict[float, list[Reading]] = {}
        for one in self.efforts:
            found.setdefault(one.length_s, []).extend(turn.reading for turn in one.turns)
        return {length: min(every, key=lambda reading: reading.wall_s) for length, every in found.items()}
