"""What undoing a fault changed, and how its cause is then known: confirmed, supported or suggested.

How often diagnoses of each status were right is read from what ``make power`` measured and published.
"""

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Final

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Observation
from fedora_qa.diagnosis.candidates import FITS, CauseCandidate
from fedora_qa.diagnosis.clock_units import checks_that_compare, is_known_unit
from fedora_qa.diagnosis.direct import (
    check_of_code,
    clears_by_construction,
    is_declared,
    is_direct,
    is_local,
    is_of_stretch,
)
from fedora_qa.diagnosis.length_units import is_length_unit
from fedora_qa.diagnosis.proposed_faults import is_testable
from fedora_qa.faults.fault import ReversibleFault, is_of_part
from fedora_qa.record.types import DiagnosisStatus

CERTAIN: Final = 0.85
"""Least support of a cause by the check whose business it is for the finding to count as a measurement of the cause."""

HALF: Final = 0.5
"""Part of a deviation that a fault leaves at most where undoing it reduces the deviation."""

_MANY_MECHANISMS: Final = frozenset(
    {
        "exposure_or_gamma",
        "frame_convention",
        "duplicated_samples",
        "unsorted",
        "swapped_frames",
        "invalid_encoding",
        "quaternion_not_unit",
    }
)
"""Causes with more mechanisms than are tried: that those clear nothing rules nothing out. Of noise of the components of
quaternions normalising takes the lengths alone, and of frames in another order one pair is exchanged, or neighbours."""

_MOSTLY: Final = 0.5
"""Share of the deviations of a cause that undoing it must remove for the cause to be supported."""

PUBLISHED: Final = Path(__file__).with_name("confidence.json")
"""Rows of status, cause (empty: all causes), diagnoses that were right, and all."""

_LEAST_FACTOR: Final = 2.0
"""Least ratio of two scales in which lengths are stored. The value is not derived: focal lengths and baselines that are
wrong scale depths by less."""

_LEFT_BY_FIT: Final = 0.02
"""Largest part of a deviation that a fitted size leaves where it is that of the cause: its fit has an error. The value
is not derived."""

_ARM_OF_POSES: Final = ("lever_arm", "pose")
_ARM_OF_IMU: Final = ("lever_arm", "imu")
_OF_IMU: Final = "imu."
"""Beginning of the names and codes of checks of the IMU."""

_CHANGES: Final = frozenset({"imu.rotation.residual", "imu.rotation.worst"})
"""Findings of what no constant bias leaves."""

_SET_BACK: Final = "clocks.order.backward_steps"

_OF_TIMESTAMPS: Final = ("clocks.", "index_maps.")
"""Beginnings of the codes of findings about timestamps and what is computed of them alone."""

_DOUBLED: Final = 2.0
"""Ratio of a deviation after undoing to the one before, from which undoing counts against the cause: undoing with the
opposite sign doubles a fault."""

_NEXT_TO_NOTHING: Final = 0.1
"""Largest part of a deviation that counts as removed. The value is not derived: sizes are fitted to a few percent."""

FEWEST: Final = 20
"""Diagnoses from which the frequency of one cause is used: its standard error is then 0.11 at most. With fewer, that of
all causes of the status is used."""


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
    revealed
        Codes of ``caused`` whose deviations the checks could not have shown without the trial: another fault may have
        been hidden.
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
    agreeing
        Checks that pass with the fault undone, and could tell nothing without.
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
    agreeing: frozenset[str] = frozenset()
    revealed: frozenset[str] = frozenset()

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
    def clears_but_for_fit(self) -> bool:
        """Whether undoing the fault clears findings, causes none, and leaves no more than the error of its size."""
        return self.succeeds and all(abs(ratio) <= _LEFT_BY_FIT for ratio in self.left.values())

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
        """Findings cleared less those caused, 0 where none is cleared; and the mean ratio of what is left, negative.

        What the trial has only revealed does not count.
        """
        ratios = [min(abs(ratio), 1.0) for ratio in self.left.values()]
        caused = sum(code not in self.revealed for code in self.caused)
        net = len(self.cleared) - caused - len(self.crashed) if self.cleared else 0
        return net, -sum(ratios) / max(len(ratios), 1)

    @property
    def removed(self) -> frozenset[str]:
        """Findings that are cleared, or of which the error of a size leaves at most a tenth."""
        return self.cleared | {finding for finding, ratio in self.left.items() if abs(ratio) <= _NEXT_TO_NOTHING}

    def surpasses(self, other: "UndoTrial") -> bool:
        """Whether undoing this fault removes all that it decides, clears what the other does, and causes no more.

        The other fault approximates this one: of what it leaves or causes, this one leaves half at most. What counts as
        removed is no difference, unless this fault leaves and causes nothing at all.
        """
        cleared = self.cleared_alone or self.cleared
        is_exact = not (self.left or self.caused or self.crashed)
        left = {
            finding: ratio
            for finding, ratio in other.left.items()
            if is_exact or (self.decides((finding,)) and finding not in other.removed)
        }
        # What clears only with another fault undone is no advantage.
        is_nearer = all(f in cleared or abs(self.left.get(f, 1.0)) <= HALF * abs(ratio) for f, ratio in left.items())
        caused, caused_by_other = set(self.caused), set(other.caused)
        causes_no_more = not self.crashed and caused <= caused_by_other
        removes_all = cleared >= other.cleared and self.left.keys() <= self.removed
        return removes_all and is_nearer and causes_no_more and bool(left or caused < caused_by_other)

    def clears_as_much_as(self, other: "UndoTrial") -> bool:
        """Whether undoing this fault clears what undoing the other does, of all findings that its windows decide.

        Each fault is undone in the windows that show its own findings best: those of this one may decide fewer. What
        the other clears only because further faults were undone with it is no advantage over this one.
        """
        cleared = other.cleared_alone or other.cleared
        is_decided_alike = not any(finding in self.left for finding in cleared)
        return self.succeeds and is_decided_alike and not self.cleared.isdisjoint(cleared)


Trials = Mapping[tuple[str, str], UndoTrial]
"""Trials by cause and stream."""


def is_conclusive(candidate: CauseCandidate, codes: Mapping[str, str]) -> bool:
    """Whether a candidate is ruled out where undoing it in the whole file clears nothing.

    It is not where other mechanisms have the same cause, or where the finding that supports it most is that of a place
    or of some time, so that the fault may hold in a part of the file, or that of a declaration: values that were not
    changed do not rule out that they are declared wrongly.

    Parameters
    ----------
    candidate
        With the support that it had before trials.
    codes
        Of all findings, by their id.
    """
    if _has_other_mechanisms(candidate, codes):
        return False
    if any(h.support >= CERTAIN and is_of_stretch(codes[finding]) for finding, h in candidate.evidence.items()):
        # Undone everywhere, the rest deviates, and no stretch of time stands out.
        return False
    return not any(is_local(codes[finding]) for finding in candidate.best_findings)


def _has_other_mechanisms(candidate: CauseCandidate, codes: Mapping[str, str]) -> bool:
    """Whether a cause has mechanisms that no trial of it undoes, be it in the right place."""
    if candidate.cause == "time_offset" and any(codes[finding] == _SET_BACK for finding in candidate.evidence):
        # The clock was set within the file: timestamps before or behind that have no offset.
        return True
    if candidate.cause == "gyro_bias" and any(codes[finding] in _CHANGES for finding in candidate.evidence):
        # The mean of a bias that walks is not the bias at any time.
        return True
    return candidate.cause in _MANY_MECHANISMS or any(is_declared(codes[f]) for f in candidate.best_findings)


def is_excluded(candidate: CauseCandidate, codes: Mapping[str, str], trials: Trials) -> bool:
    """Whether a trial excludes a candidate: undone in the whole file, it leaves what it would explain.

    Undone in a part, it excludes nothing: the edges of a part are known to a step of the samples, and those beside them
    still deviate. Parameters are those of ``is_conclusive``.
    """
    trial = trials.get(candidate.key)
    if trial is None or not trial.fails or is_of_part(trial.fault):
        return False
    return _concerns(trial, candidate) and is_conclusive(candidate, codes)


def is_refuted(candidate: CauseCandidate, codes: Mapping[str, str], trials: Trials) -> bool:
    """Whether the trial of a cause of some place or time fails, and no check is certain of the cause.

    The fault may hold elsewhere than where it was undone. A cause of which a check is certain keeps its name then; a
    cause that merely fits better than others does not.
    """
    trial = trials.get(candidate.key)
    if trial is None or not trial.fails or has_evidence(candidate, codes, trials):
        return False
    if not _concerns(trial, candidate) or _has_other_mechanisms(candidate, codes):
        return False
    return is_of_part(trial.fault) or candidate.best_support < CERTAIN


def _concerns(trial: UndoTrial, candidate: CauseCandidate) -> bool:
    """Whether a trial that fails leaves any finding that the candidate would explain.

    Of two faults in one file, undoing either leaves the findings of the other, which say nothing of it.
    """
    return not trial.left or any(finding in trial.left for finding in candidate.evidence)


def is_scale_by_chance(candidate: CauseCandidate, trials: Trials) -> bool:
    """Whether lengths have a fitted factor that is the ratio of no two units, and that undoing it does not prove.

    A factor is fitted to whatever makes depths and path disagree. One that is the cause leaves what the rounding of its
    fit leaves, of every finding that the trial shows, and brings none about. A factor near 1 is that of a calibration.
    """
    factor = candidate.size.magnitude
    if candidate.cause != "unit_mm_m" or factor is None or is_length_unit(factor):
        return False
    if 1 / _LEAST_FACTOR < factor < _LEAST_FACTOR:
        return True
    trial = trials.get(candidate.key)
    return trial is None or not trial.clears_but_for_fit


def is_unit_by_chance(candidate: CauseCandidate, codes: Mapping[str, str], trials: Trials) -> bool:
    """Whether timestamps have a factor that only the span of the stream states, and that undoing it does not prove.

    The span of a stream that was cut off is that of the others once it is stretched. A factor that is the cause brings
    the content of the stream into agreement with others, and brings no finding about.
    """
    factor = candidate.size.magnitude
    if candidate.cause != "time_unit" or factor is None or is_known_unit(factor):
        return False
    if any(is_direct(candidate.cause, codes[finding], candidate.stream) for finding in candidate.evidence):
        return False
    trial = trials.get(candidate.key)
    return trial is None or not trial.succeeds or not _is_compared(trial, codes)


def _is_compared(trial: UndoTrial, codes: Mapping[str, str]) -> bool:
    """Whether a trial of timestamps clears more than their own findings, or lets the content agree with others."""
    of_content = (code for finding in trial.cleared if not (code := codes[finding]).startswith(_OF_TIMESTAMPS))
    return any(of_content) or bool(trial.agreeing & checks_that_compare(trial.fault.stream))


def clears_by_chance(candidate: CauseCandidate, codes: Mapping[str, str], trial: UndoTrial) -> bool:
    """Whether what a trial clears is no evidence: it doubles more, or the same checks leave some of a weak cause.

    A fault changes what it has nothing to do with, and of several findings of one check, one just beyond its limit may
    fall within it. A fault that is the cause takes all findings of such a check, and enlarges none.

    Parameters
    ----------
    candidate
        With the support that it had before trials.
    codes
        Of all findings, by their id.
    trial
        Of its fault.
    """
    if 0 < len(trial.cleared) < sum(abs(ratio) >= _DOUBLED for ratio in trial.left.values()):
        return True
    left = {check_of_code(codes[finding]) for finding in trial.left}
    cleared = {check_of_code(codes[finding]) for finding in trial.cleared}
    return candidate.best_support < FITS and bool(cleared) and cleared <= left


def has_evidence(candidate: CauseCandidate, codes: Mapping[str, str], trials: Trials) -> bool:
    """Whether undoing a candidate clears findings, or a check measures the cause itself.

    Parameters
    ----------
    candidate
        With the findings that it would explain.
    codes
        Of all findings, by their id.
    trials
        Of candidates whose fault was undone.
    """
    trial = trials.get(candidate.key)
    if trial is not None and trial.cleared:
        return not clears_by_chance(candidate, codes, trial)
    untested = trial is None or not is_conclusive(candidate, codes)
    supported = (finding for finding, h in candidate.evidence.items() if h.support >= FITS)
    return untested and any(is_direct(candidate.cause, codes[finding], candidate.stream) for finding in supported)


def status_of(
    candidate: CauseCandidate,
    findings: Collection[str],
    codes: Mapping[str, str],
    trials: Trials,
    rivals: Sequence[CauseCandidate],
    likely: Collection[tuple[str, str]],
) -> tuple[DiagnosisStatus, list[UndoTrial]]:
    """Return how a cause is known, and the trials of rivals that clear as much.

    Parameters
    ----------
    candidate
        The cause that was chosen.
    findings
        That it explains.
    codes, trials
        As of ``has_evidence``.
    rivals
        Candidates that could be the cause in its place.
    likely
        Keys of rivals that fit well enough to be tested before anything is confirmed.
    """
    trial = trials.get(candidate.key)
    has_own = has_evidence(candidate, codes, trials)
    if trial is None or not trial.cleared or clears_by_chance(candidate, codes, trial):
        return ("supported" if has_own else "suggested"), []
    # A fault of all rates of flow and the same fault of one rate are no rivals.
    others = [
        r for r in rivals if (r.cause, stream_family(r.stream)) != (candidate.cause, stream_family(candidate.stream))
    ]
    tested = [trials[rival.key] for rival in others if rival.key in trials]
    if _ARM_OF_POSES in trials and any(rival.key == _ARM_OF_IMU for rival in others):
        tested.append(_of_arm_of_imu(trials[_ARM_OF_POSES], codes))
    alike = [other for other in tested if other.clears_as_much_as(trial)]
    undecided = any(
        not _is_decided(rival, trial.cleared_alone or trial.cleared, trials)
        for rival in others
        if rival.key in likely and is_testable(rival.cause, rival.stream, rival.size.magnitude)
    )
    left = [finding for finding in findings if finding in trial.left]
    # What vanishes by construction confirms a cause only where no other finding asks for another one of the timestamps.
    by_construction = all(clears_by_construction(candidate.cause, codes[finding]) for finding in trial.cleared)
    of_clocks = any(code.startswith("clocks.") and finding not in trial.cleared for finding, code in codes.items())
    if trial.succeeds and not left and not alike and not undecided and not (by_construction and of_clocks):
        return "confirmed", []
    # A finding that is left counts by the share of its deviation that is removed.
    removed = len(trial.cleared) + sum(max(1.0 - abs(trial.left[finding]), 0.0) for finding in left)
    mostly = removed >= _MOSTLY * (len(trial.cleared) + len(left) + len(trial.caused))
    return ("supported" if mostly else "suggested"), alike


def _of_arm_of_imu(trial: UndoTrial, codes: Mapping[str, str]) -> UndoTrial:
    """Return a trial of the lever arm of the poses as one of the IMU: what other streams state of it stays as it was.

    The arm of the IMU has no inverse. Between IMU and poses it is that of the poses.
    """
    cleared = frozenset(finding for finding in trial.cleared if codes[finding].startswith(_OF_IMU))
    of_others = dict.fromkeys((trial.cleared | trial.left.keys()) - cleared, 1.0)
    left = {finding: ratio for finding, ratio in trial.left.items() if codes[finding].startswith(_OF_IMU)}
    caused = tuple(code for code in trial.caused if code.startswith(_OF_IMU))
    crashed = tuple(check for check in trial.crashed if check.startswith(_OF_IMU))
    return replace(trial, cleared=cleared, left={**of_others, **left}, caused=caused, crashed=crashed)


def _is_decided(rival: CauseCandidate, cleared: Collection[str], trials: Trials) -> bool:
    """Whether a trial of a rival decides any finding that the cause clears and the rival would explain, too."""
    trial = trials.get(rival.key)
    if trial is None:
        return False
    contested = [finding for finding in cleared if finding in rival.evidence]
    return trial.decides(contested) if contested else trial.is_decided


def confidence_of(status: DiagnosisStatus, cause: str) -> float:
    """Return the measured frequency, 0 to 1, with which such diagnoses were right; 0 where none was measured."""
    published = _published()
    own, all_causes = published.get((status, cause), (0, 0)), published.get((status, ""), (0, 0))
    right, of = own if own[1] >= FEWEST else all_causes
    return right / of if of >= FEWEST else 0.0


@cache
def _published() -> Mapping[tuple[str, str], tuple[int, int]]:
    rows = json.loads(PUBLISHED.read_text("utf-8")) if PUBLISHED.exists() else []
    return {(status, cause): (right, of) for status, cause, right, of in rows}
