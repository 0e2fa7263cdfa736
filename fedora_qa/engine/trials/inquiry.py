"""Undo the proposed faults of all candidates, the first mechanism of each before the second of any."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Final

from fedora_qa.diagnosis.candidates import CONTENDS, CauseCandidate
from fedora_qa.diagnosis.clock_grids import ClockPlace
from fedora_qa.diagnosis.conclusion import UndoTrial
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.diagnosis.vetoes import contradicts
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.trials.trial import TrialBench
from fedora_qa.faults.fault import ReversibleFault

_MOST_VARIANTS: Final = 5
"""Mechanisms or directions of one cause that are tried: of poses in another convention the fitted ones, of rotations
and of specific forces, in two variants each, and another order of angles."""

_STRAIGHT: Final = 0.8
"""Largest part of a deviation that may be left for a second fit of the size: with more, another fault is at work."""

_SIZED: Final = 0.05
"""Least relative change of a size by a second fit for which the fault is tried again."""


@dataclass(slots=True)
class _Inquiry:
    """The mechanisms of one candidate that are still to be undone, and its best trial so far.

    Attributes
    ----------
    candidate
        The cause.
    bench
        Undoes its mechanisms.
    places
        Of the clocks.
    best
        The trial that clears most.
    size
        Size of the mechanisms, in the unit of the cause.
    """

    candidate: CauseCandidate
    bench: TrialBench
    places: Mapping[str, ClockPlace]
    best: UndoTrial | None = field(init=False, default=None)
    size: float | None = field(init=False)
    _waiting: Iterator[ReversibleFault] = field(init=False)
    _is_refitted: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        """Propose the mechanisms with the fitted size."""
        self.size = self.candidate.size.magnitude
        self._waiting = self._mechanisms()

    def step(self) -> bool:
        """Undo the next mechanism; return False where none is left, or where nothing is left to clear."""
        if self.clears_all:
            return False
        fault = next(self._waiting, None)
        if fault is None and self._fits_again():
            fault = next(self._waiting, None)
        if fault is None:
            return False
        trial = self.bench.undo(fault)
        # Of two mechanisms that clear as much, that counts after which fewer checks deviate.
        if trial is not None and (
            self.best is None or (trial.balance, -len(trial.caused)) > (self.best.balance, -len(self.best.caused))
        ):
            self.best = replace(trial, size=self.size) if self._is_refitted else trial
        return True

    @property
    def clears_all(self) -> bool:
        """Whether the best trial clears all that its windows show, and causes nothing."""
        return self.best is not None and self.best.succeeds and not self.best.left

    def _mechanisms(self) -> Iterator[ReversibleFault]:
        cause, stream, run = self.candidate.cause, self.candidate.stream, self.bench.run
        faults = faults_for(cause, stream, self.size, self.bench.alarms, run.strict, run.ready.facts)
        return islice(dict.fromkeys(faults), _MOST_VARIANTS)

    def _fits_again(self) -> bool:
        """Propose the mechanisms with the size by which the deviation that gave it vanishes, once."""
        sized_by = self.candidate.sized_by
        if self._is_refitted or self.best is None or self.size is None or sized_by not in self.best.left:
            return False
        # Secant: with d deviations of d0 without and d1 with the size undone, d vanishes at size d0 / (d0 - d1).
        ratio = self.best.left[sized_by]
        again = self.size / (1.0 - ratio) if ratio < _STRAIGHT else self.size
        cause, stream, results = self.candidate.cause, self.candidate.stream, self.bench.run.strict
        if abs(again - self.size) <= _SIZED * abs(self.size) or contradicts(cause, stream, again, results, self.places):
            return False
        self.size, self._is_refitted = again, True
        self._waiting = self._mechanisms()
        return True


def run_trials(
    bench: TrialBench, candidates: Sequence[CauseCandidate], places: Mapping[str, ClockPlace], progress: Progress
) -> dict[tuple[str, str], UndoTrial]:
    """Undo the faults of candidates, best supported first; return the best trial of each by cause and stream.

    The first mechanism of every candidate is undone before the second of any: where the work runs out, mechanisms of
    one cause have not used up what another cause needs.
    """
    # Only rivals of the best supported candidate are of interest, and then of a fault that clears all that is shown.
    least = CONTENDS * candidates[0].total_support if candidates else 0.0
    inquiries = [_Inquiry(candidate, bench, places) for candidate in candidates]
    waiting = inquiries
    while waiting:
        going_on = []
        for inquiry in waiting:
            if inquiry.candidate.total_support < least:
                break
            progress("undoing proposed faults", len(inquiries) - len(waiting), len(inquiries))
            if inquiry.step():
                going_on.append(inquiry)
            if inquiry.clears_all:
                least = max(least, CONTENDS * inquiry.candidate.total_support)
        waiting = going_on
    return {inquiry.candidate.key: inquiry.best for inquiry in inquiries if inquiry.best is not None}
