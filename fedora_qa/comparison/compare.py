"""Compare subjects with the first of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fedora_qa import __version__
from fedora_qa.comparison.distances import PairedCounts, difference_of, paired_counts
from fedora_qa.comparison.distributions import Int64, meaning_of, shares_of, unit_of
from fedora_qa.comparison.paper_tables import PUBLISHED
from fedora_qa.comparison.subjects import Match, SubjectInput, design_of, matches
from fedora_qa.comparison.types import COMPARISON_VERSION, Comparison, Design, Overlay, Pair, Versions
from fedora_qa.comparison.versions import count_with_errors, record_changes, statistic_changes
from fedora_qa.errors import MisuseError
from fedora_qa.evidence.value_counts import octave_edges
from fedora_qa.record.types import Tool


@dataclass(frozen=True, slots=True)
class _PairPlan:
    """The comparisons of one pair, known before any is judged, so that all can share one false-alarm rate."""

    before: SubjectInput
    after: SubjectInput
    place: int
    design: Design
    distributions: tuple[PairedCounts, ...]
    matched: tuple[Match, ...]

    @property
    def tests(self) -> int:
        return len(self.distributions) + sum(
            count_with_errors(match.before.statistics, match.after.statistics) for match in self.matched
        )


def compare(inputs: Sequence[SubjectInput], design: Design | None, false_alarm_rate: float) -> Comparison:
    """Compare two or more subjects with the first.

    Parameters
    ----------
    inputs
        The subjects, the reference first.
    design
        What they are to each other; None where their names decide.
    false_alarm_rate
        Probability, 0 to 1, that any test of the whole comparison reports a difference where there is none.

    Returns
    -------
    Comparison
        The whole document.

    Raises
    ------
    MisuseError
        There are fewer than two, or versions have no file in common.
    """
    if len(inputs) < 2:
        raise MisuseError(f"Expected two or more subjects to compare, got {len(inputs)}")
    # All tests are counted before the first is judged: they share one false-alarm rate.
    before, planned = inputs[0], list[_PairPlan]()
    for place, after in enumerate(inputs[1:], start=1):
        pair_design = design or design_of(before, after)
        matched = matches(before, after) if pair_design == "versions" else ()
        if pair_design == "versions" and not matched:
            raise MisuseError(
                f"Expected versions of the same files, got none in {after.name} named as one in {before.name}; "
                "compare them as sequences or datasets"
            )
        distributions = paired_counts(before, after, pair_design)
        planned.append(_PairPlan(before, after, place, pair_design, distributions, matched))
    tests = sum(item.tests for item in planned)
    # Bonferroni: valid whatever the dependence of the tests.
    level = false_alarm_rate / max(tests, 1)
    pairs = tuple(
        Pair(
            before=0,
            after=item.place,
            design=item.design,
            differences=tuple(difference_of(counts, level) for counts in item.distributions),
            versions=_versions(item, level) if item.design == "versions" else None,
        )
        for item in planned
    )

    # What could not be compared.
    notes: list[str] = []
    for subject in inputs:
        lacking = [name for name, file in subject.by_name.items() if file.sampled is None]
        if lacking:
            notes.append(
                f"{subject.name}: nothing is known of the distributions of {', '.join(lacking[:3])}"
                f"{f' and {len(lacking) - 3} more' if len(lacking) > 3 else ''}; its record is of an earlier version, "
                "or its arrays do not lie beside it."
            )
    checked = [subject.name for subject in inputs if any(file.record for file in subject.files)]
    if checked and len(checked) < len(inputs):
        notes.append("Findings are compared only where both sides are records of `fedora-qa check`.")
    return Comparison(
        comparison_version=COMPARISON_VERSION,
        tool=Tool("fedora-qa", __version__),
        false_alarm_rate=false_alarm_rate,
        tests=tests,
        level=level,
        subjects=tuple(item.subject for item in inputs),
        overlays=tuple(_overlays(inputs)),
        pairs=pairs,
        published=PUBLISHED,
        notes=tuple(notes),
    )


def _versions(planned: _PairPlan, level: float) -> Versions:
    changes = [
        record_changes(item.name, item.before.record, item.after.record)
        for item in planned.matched
        if item.before.record and item.after.record
    ]
    before, after = planned.before.by_name, planned.after.by_name
    # By identity: two single files are versions of each other under different names.
    matched_files = {id(file) for item in planned.matched for file in (item.before, item.after)}
    return Versions(
        matched=len(planned.matched),
        checked=len(changes),
        gone=tuple(name for name, file in before.items() if id(file) not in matched_files),
        new=tuple(name for name, file in after.items() if id(file) not in matched_files),
        findings=tuple(finding for item in changes for finding in item.findings),
        unchanged_findings=sum(item.unchanged for item in changes),
        outcomes=tuple(outcome for item in changes for outcome in item.outcomes),
        measurements=tuple(moved for item in changes for moved in item.measurements),
        statistics=tuple(
            change
            for item in planned.matched
            for change in statistic_changes(item.name, item.before.statistics, item.after.statistics, level)
        ),
    )


def _overlays(inputs: Sequence[SubjectInput]) -> Iterator[Overlay]:
    """Yield the distribution of every quantity that any subject has, all its files together."""
    quantities = dict.fromkeys(
        q for subject in inputs for file in subject.files if file.sampled for q in file.sampled.counts
    )
    for quantity in quantities:
        totals: list[Int64 | None] = []
        for subject in inputs:
            counts = [
                file.sampled.total(quantity)
                for file in subject.files
                if file.sampled and quantity in file.sampled.counts
            ]
            totals.append(np.asarray(np.sum(counts, axis=0)) if counts else None)
        # One range of bins for all subjects, so that their shares can be drawn over each other.
        filled_bins = np.flatnonzero(np.any([total > 0 for total in totals if total is not None], axis=0))
        first, last = int(filled_bins[0]), int(filled_bins[-1]) + 1
        shares = tuple(
            None if total is None else tuple(float(share) for share in shares_of(total[first:last])) for total in totals
        )
        edges = tuple(float(edge) for edge in octave_edges()[first : last + 1])
        yield Overlay(quantity, meaning_of(quantity), unit_of(quantity), edges, shares)
