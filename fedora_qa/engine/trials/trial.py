"""Trials: undo a proposed fault in a view of the sequence, and measure again.

The checks that failed measure again, and those that read the stream of the fault. A fault is tried on the window of the
worst finding first; one that clears a finding there is tried on four times as many windows around it, and so on up to
all that the run measured. The same windows are measured without the fault undone: a finding counts as cleared only
where its deviation is seen on these windows with the fault in place. What a fault that clears findings brings about
between IMU and poses is measured in all windows. Work is counted in windows for one check and bounded by what the run
itself measured, or one of a few more windows would, never by the clock, so that a record does not depend on the
machine.
"""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Any, Final

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.diagnosis.clock_units import is_known_unit
from fedora_qa.diagnosis.conclusion import HALF, DeviationChange, UndoTrial
from fedora_qa.engine.survey import Prepared
from fedora_qa.engine.trials.altered import PlainRun, WindowPass, around
from fedora_qa.engine.trials.deviations import (
    change_of,
    check_of,
    counted,
    deviation_of,
    exceeding,
    measurement_of,
    ratio_left,
    ratio_to_limit,
    results_by_check,
    rule_of,
    would_hide,
)
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import Fault, ReversibleFault
from fedora_qa.judgement.judge import Alarm, judge
from fedora_qa.judgement.materiality import Materiality
from fedora_qa.record.types import Measurement, Result
from fedora_qa.sequence.window import Span

_GROWTH: Final = 4
"""Ratio of the windows of one trial to those of the trial before: all trials of a fault together cost a third more than
the last one."""

_FAR: Final = 2.0
"""Ratio of a deviation to its limit from which other comparisons do not decide. For twice as many standard errors at a
false-alarm rate of 1e-3 there would have to be 1e13 comparisons in place of a hundred."""

_OF_SAMPLES: Final = frozenset({"imu", "pose"})
"""Streams of which every window is read in little time."""

_OF_NOISE: Final = ("imu.noise.", "pose.noise.")
"""Beginnings of the codes of findings that differences of neighbouring samples state."""

_FEWEST_WINDOWS: Final = 16
"""Windows of a short sequence for which trials may work as long as the run of so many would take. The value is not
derived: of 8 windows a fault that is shown by 4 of them takes a quarter of the work, and the cause may be the fifth."""

_OF_ENDS: Final = "clocks.span."
"""Beginning of the codes of findings about the first and last timestamps of streams."""

_SHARE_OF_A_FAULT: Final = 0.5
"""Most of the work that is left which further windows of one fault may take."""


@dataclass(slots=True)
class TrialWork:
    """Windows for one check that trials may still measure."""

    left: int

    def take(self, windows: int) -> None:
        """Count windows that are measured."""
        self.left -= windows


@dataclass(slots=True)
class TrialBench:
    """The run of a file whose findings are to be explained, and the work that trials may still do on it.

    Attributes
    ----------
    alarms
        Of the plain run.
    checks
        Those whose question can be asked of the file.
    run
        The plain run.
    work
        Of all trials of the file.
    windows
        How many the latest trial of a fault measured, where undoing it reduces deviations.
    """

    alarms: Sequence[Alarm]
    checks: Sequence[Check[Any]]
    run: PlainRun
    work: TrialWork
    windows: dict[ReversibleFault, int] = field(init=False, default_factory=dict)
    _plain: dict[int, list[tuple[Alarm, Measurement]]] = field(init=False, default_factory=dict)
    _plain_observations: dict[int, Mapping[str, Observation]] = field(init=False, default_factory=dict)
    _plain_pass: WindowPass | None = field(init=False, default=None)

    @staticmethod
    def of(alarms: Sequence[Alarm], checks: Sequence[Check[Any]], run: PlainRun) -> "TrialBench":
        """Return the bench of a run, with as much work as the run itself took, or that of a longer one would."""
        windows = max(len(run.planned(run.ready)), _FEWEST_WINDOWS)
        return TrialBench(alarms, checks, run, TrialWork(windows * len(checks)))

    def undo(self, fault: ReversibleFault) -> UndoTrial | None:
        """Undo a fault alone, and return what that changes; None where it cannot be undone, or no work is left."""
        planned = len(self.run.planned(self.run.ready))
        if self.work.left <= planned:
            return None
        try:
            undoing = fault.undo(self.run.ready.facts, self.run.sequence)
            prepared = self.run.altered_by(undoing)
        # Rows that are damaged, or a size without meaning: what cannot be undone is not tested, and the record stands.
        except Exception:  # noqa: BLE001 - any error of a trial costs this trial only
            return None
        if undoing.moves_time:
            # All timestamps were read again, as by one check in all windows.
            self.work.take(planned)
        failed = {check_of(alarm) for alarm in self.alarms}
        affected = self._affected(fault, failed)
        trial: UndoTrial | None = None
        inner: WindowPass | None = None
        for count in self._counts():
            if not self._deviations(count, fault):
                continue
            # Half of the work stays for rivals, without which nothing is confirmed.
            if count * len(affected) > self.work.left * (_SHARE_OF_A_FAULT if trial else 1.0):
                break
            spans = self._spans_of(prepared, count)
            if inner is None:
                # A fault that clears nothing is the cause of nothing, whatever it changes in the other checks.
                self.work.take(len(spans) * len(affected))
                of_alarms = [check for check in affected if check.name in failed]
                part = self.run.judged(of_alarms, spans, prepared)
                if self._leaves_all(part, count, fault):
                    trial = self._compared(fault, undoing, part, count)
                    break
                others = [check for check in affected if check.name not in failed]
                inner = self.run.widened(part, others, affected, prepared)
            else:
                inner = self._judged(affected, spans, prepared, inner)
            trial = self._compared(fault, undoing, inner, count)
            decided = len(trial.cleared) + len(trial.left)
            # Where the windows show a finding and the fault clears none, or brings others about, more windows change
            # nothing: the work is left for rivals.
            if (decided and not trial.cleared) or trial.caused:
                break
            # The span alone shows no unit but the known ones: the content is compared in all windows.
            if decided == len(self.alarms) and (fault.cause != "time_unit" or is_known_unit(fault.magnitude or 0.0)):
                break
        if trial is not None and inner is not None and trial.reduces:
            self.windows[fault] = len(inner.spans)
        return None if trial is None else self._in_all_windows(trial, affected, prepared)

    def _in_all_windows(self, trial: UndoTrial, affected: Sequence[Check[Any]], prepared: Prepared) -> UndoTrial:
        """Return a trial with what it brings about between IMU and poses in the whole file.

        Few windows hold few samples, of which noise hides what the whole contradicts.
        """
        planned = self.run.planned(prepared)
        of_samples = [check for check in affected if {*check.needs, *check.looks_at} <= _OF_SAMPLES]
        work = len(planned) * len(of_samples)
        if not trial.succeeds or trial.windows >= len(planned) or not of_samples or work > self.work.left:
            return trial
        self.work.take(work)
        judged = results_by_check(self.run.judged(of_samples, planned, prepared).judged)
        exceeded = {rule_of(m) for result in self.run.strict.values() for m in exceeding(result)}
        caused = {rule_of(m) for result in judged.values() for m in exceeding(result)} - exceeded
        codes = tuple(sorted({code for code, _ in caused}))
        return replace(trial, caused=codes, revealed=self._revealed(judged, codes))

    def _revealed(self, judged: Mapping[str, Result], caused: Collection[str]) -> frozenset[str]:
        """Return the codes among those that a trial caused whose deviations the plain run could not have shown."""
        return frozenset(
            m.code
            for check, result in judged.items()
            for m in exceeding(result)
            if m.code in caused and would_hide(self.run.strict.get(check), m)
        )

    def without(self, fault: ReversibleFault, materiality: Materiality) -> "TrialBench | None":
        """Return the bench of the sequence with a fault undone in all windows, and the work that is left.

        None where less work is left than that takes, or where what was altered cannot be measured.
        """
        run = self.run
        affected = self._affected(fault, {check_of(alarm) for alarm in self.alarms})
        # Second looks count neither here nor in what the run itself measured, and windows of its trial no second time.
        work = (len(run.planned(run.ready)) - self.windows.get(fault, 0)) * len(affected)
        if work > self.work.left:
            return None
        self.work.take(work)
        try:
            undoing = fault.undo(run.ready.facts, run.sequence)
            run = run.without(undoing, self.checks, affected)
            judged = judge(run.observations, self.checks, run.false_alarm_rate, materiality)
        except Exception:  # noqa: BLE001 - as in ``undo``
            return None
        return TrialBench([alarm for each in judged for alarm in each.alarms], self.checks, run, self.work)

    def left_of(self, alarms: Sequence[Alarm], strict: Mapping[str, Result]) -> dict[str, float]:
        """Return which part of the deviations of another run is left in this one, where they exceed their limits.

        Returns
        -------
        dict
            By the id of the finding; deviations that are material and those that are not.
        """
        left = {}
        for alarm in alarms:
            before, after = (
                None if result is None else measurement_of(result, alarm)
                for result in (strict.get(check_of(alarm)), self.run.strict.get(check_of(alarm)))
            )
            if before is not None and after is not None and after.exceeds_limit:
                left[alarm.finding.id] = ratio_left(after, before)
        return left

    def ratios(
        self,
        fault: ReversibleFault | None,
        alarms: Sequence[Alarm],
        checks: Sequence[Check[Any]],
        count: int,
        observed: Mapping[str, Observation] | None = None,
    ) -> list[float] | None:
        """Return deviations over their limits in some windows, with a fault undone or with none.

        Parameters
        ----------
        fault
            To undo; None measures the file as it is.
        alarms
            Whose deviations are asked for.
        checks
            Their checks.
        count
            Number of windows, of those of a trial.
        observed
            What a trial of the fault observed in these windows, which are not measured again; None where there was
            none. The work counts in either case, so that it does not depend on what is kept.

        Returns
        -------
        list of float or None
            A ratio for each alarm, 0 where the check no longer states the deviation, NaN where it cannot tell; None
            where the fault cannot be undone.
        """
        prepared = self.run.ready
        if fault is not None:
            try:
                undoing = fault.undo(self.run.ready.facts, self.run.sequence)
                prepared = self.run.altered_by(undoing)
            except Exception:  # noqa: BLE001 - as in ``undo``
                return None
            if undoing.moves_time:
                self.work.take(len(self.run.planned(self.run.ready)))
        spans = self._spans_of(prepared, count)
        if observed is None:
            judged = self._judged(checks, spans, prepared, None).judged
        else:
            self.work.take(len(spans) * len(checks))
            judged = self.run.judge_observed(checks, observed)
        results = results_by_check(judged)
        return [ratio_to_limit(results.get(check_of(alarm)), alarm) for alarm in alarms]

    def affordable(self, passes: int, checks: int, most: int) -> int:
        """Return the most windows of a trial, up to ``most``, that several passes of some checks may measure yet.

        All timestamps may have to be read again for each pass. 0 where no work is left.
        """
        counts = self._counts()
        left = self.work.left // passes - counts[-1]
        return max((count for count in counts if count <= most and count * checks <= left), default=0)

    def _counts(self) -> list[int]:
        """Return the numbers of windows of successive trials: 1, 4, 16 ... and all."""
        whole, counts = len(self.run.planned(self.run.ready)), [1]
        while counts[-1] * _GROWTH < whole:
            counts.append(counts[-1] * _GROWTH)
        return [*counts, whole] if whole > counts[-1] else counts

    def _affected(self, fault: ReversibleFault, failed: Set[str]) -> list[Check[Any]]:
        families = _families_read_with(fault)
        return [
            check
            for check in self.checks
            if check.name in failed
            or families is None
            or families & {stream_family(stream) for stream in (*check.needs, *check.looks_at)}
            or (fault.stream == "metadata" and check.name.startswith("metadata."))
        ]

    def _spans_of(self, prepared: Prepared, count: int) -> Sequence[Span]:
        """Return windows of an altered sequence, whose timestamps may fall into others: all where all are measured."""
        planned = self.run.planned(prepared)
        whole = count >= len(self.run.planned(self.run.ready))
        return planned if whole else around(planned, place_ns(self.alarms, self.run), count)

    def _compared(self, fault: ReversibleFault, undoing: Fault, altered: WindowPass, count: int) -> UndoTrial:
        """Hold what was measured with a fault undone against the same windows without it undone."""
        judged = results_by_check(altered.judged)
        cleared: set[str] = set()
        left: dict[str, float] = {}
        changes: list[DeviationChange] = []
        for alarm, deviating in self._deviations(count, fault):
            after = judged.get(check_of(alarm))
            if after is None or after.outcome in ("crashed", "not_observable"):
                continue
            again = measurement_of(after, alarm)
            if again is None:
                # What is stated only where it deviates no longer deviates, unless the check now asks something else.
                if undoing.declared is None and after.outcome == "passed":
                    cleared.add(alarm.finding.id)
                    changes.append(change_of(alarm, deviating, None))
                continue
            changes.append(change_of(alarm, deviating, again))
            if again.exceeds_limit:
                left[alarm.finding.id] = ratio_left(again, deviating)
            elif again.limit is not None and again.limit < abs(deviation_of(deviating)):
                # Under a larger limit the deviation would have passed, too.
                cleared.add(alarm.finding.id)
        exceeded = {rule_of(m) for result in self.run.strict.values() for m in exceeding(result)}
        caused = {rule_of(m) for result in judged.values() for m in exceeding(result)} - exceeded
        return UndoTrial(
            fault,
            undoing.description,
            frozenset(cleared),
            left,
            tuple(sorted({code for code, _ in caused})),
            count,
            tuple(sorted(altered.crashes)),
            deviations=tuple(changes),
            observations={
                check: (self._plain_observations[count][check], altered.observations[check])
                for check in sorted({change.check for change in changes})
                if check in altered.observations
            },
            agreeing=frozenset(
                check
                for check, result in judged.items()
                if result.outcome == "passed"
                and (before := self.run.strict.get(check)) is not None
                and before.outcome == "not_observable"
            ),
            revealed=self._revealed(judged, {code for code, _ in caused}),
        )

    def _leaves_all(self, altered: WindowPass, count: int, fault: ReversibleFault) -> bool:
        """Whether undoing a fault leaves more than half of each deviation, and twice its limit whatever else is judged.

        Limits grow with the number of comparisons in all checks, and are not doubled by any number that occurs.
        """
        judged = results_by_check(altered.judged)
        for alarm, deviating in self._deviations(count, fault):
            after = judged.get(check_of(alarm))
            again = None if after is None or after.outcome == "not_observable" else measurement_of(after, alarm)
            if again is None or again.limit is None or not again.exceeds_limit:
                return False
            if abs(counted(again)) <= _FAR * again.limit or abs(ratio_left(again, deviating)) <= HALF:
                return False
        return True

    def _judged(
        self, checks: Sequence[Check[Any]], spans: Sequence[Span], prepared: Prepared, inner: WindowPass | None
    ) -> WindowPass:
        # Windows of the trial before count again: the bound on work, and so the record, is that of trials on their own.
        self.work.take(len(spans) * len(checks))
        return self.run.judged(checks, spans, prepared, inner)

    def _deviations(self, count: int, fault: ReversibleFault) -> list[tuple[Alarm, Measurement]]:
        """Return the findings that the windows of a trial show without the fault undone, with their measurements.

        Without those of which undoing it can show nothing.
        """
        return [each for each in self._shown(count) if not _is_beyond(fault, each[0].finding.code)]

    def _shown(self, count: int) -> list[tuple[Alarm, Measurement]]:
        if count not in self._plain:
            failed = {check_of(alarm) for alarm in self.alarms}
            planned = self.run.planned(self.run.ready)
            results: Mapping[str, Result] = self.run.strict
            observations = self.run.observations
            if count < len(planned):
                checks = [check for check in self.checks if check.name in failed]
                spans = around(planned, place_ns(self.alarms, self.run), count)
                self._plain_pass = self._judged(checks, spans, self.run.ready, self._plain_pass)
                results, observations = results_by_check(self._plain_pass.judged), self._plain_pass.observations
            self._plain_observations[count] = observations
            pairs = (
                (alarm, measurement_of(results[check_of(alarm)], alarm))
                for alarm in self.alarms
                if check_of(alarm) in results
            )
            self._plain[count] = [(alarm, m) for alarm, m in pairs if m is not None and m.exceeds_limit]
        return self._plain[count]


def _is_beyond(fault: ReversibleFault, code: str) -> bool:
    """Whether a finding, by its code, is of noise and the fault moves all timestamps of a stream alike.

    That changes no difference of samples, whether the values are late because of a filter or not.
    """
    moves_all = isinstance(fault, ClockShift) and fault.rows is fault.while_ns is fault.regular_ns is None
    return moves_all and code.startswith(_OF_NOISE)


def _families_read_with(fault: ReversibleFault) -> Set[str] | None:
    """Return the streams, rates of flow as one, that checks read together with what a fault alters; None for all."""
    family = stream_family(fault.stream)
    if family != "metadata":
        return {family}
    # A declared camera is read with its images, and that of depth with the flow as well; other declarations by all.
    camera = getattr(fault, "camera", None)
    return None if camera is None else {camera, "flow"} if camera == "depth" else {camera}


def place_ns(alarms: Sequence[Alarm], run: PlainRun) -> int:
    """Return the middle of the first finding that has a time; the middle of the file where none has.

    Where a stream begins or ends it has no values that deviate: such findings are last.
    """
    facts = run.ready.facts
    for alarm in sorted(alarms, key=lambda each: each.finding.code.startswith(_OF_ENDS)):
        where = alarm.finding.where
        if where.start_us is not None and where.stop_us is not None:
            return facts.from_file_us((where.start_us + where.stop_us) / 2)
    spans = run.planned(run.ready)
    return (spans[0].start_ns + spans[-1].stop_ns) // 2 if spans else 0
