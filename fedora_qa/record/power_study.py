"""A study of detection: its results, and these as tables of text.

Field names of the results are relied on by others and never change within a version. A cause is written
``stream:identifier``. Magnitudes are sizes: positive, whatever the sign of the planted fault. Values that are
unknown, or beyond the sizes of the trials, are None. The tables are the same in the terminal and in the report.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Final, Literal

from pydantic import TypeAdapter

from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.markdown import escape, table_section
from fedora_qa.record.tables import TextTable
from fedora_qa.record.types import DiagnosisStatus, Tool
from fedora_qa.record.wording import number

POWER_VERSION: Final = "1.0"

WHOLE_FILE: Final = ""
"""Stands for a check where any check that fails counts."""

NOT_FOUND: Final = "not found"
NO_CAUSE: Final = "no cause"
"""Stand for a first-named cause where no check failed, and where one did and nothing was named."""

Kind = Literal["single", "local", "composite"]
Fitted = Literal["fitted", "all_found", "none_found", "not_rising", "too_few", "no_size"]
ComparedBy = Literal["size", "response"]
Truth = Literal["true", "too_bold", "too_cautious", "untested"]

_ANY_CHECK: Final = "any check"

_TRUTH_WORDS: Final[dict[Truth, str]] = {
    "true": "true",
    "too_bold": "too bold",
    "too_cautious": "too cautious",
    "untested": "untested",
}

_WHY_NO_FIT: Final[dict[Fitted, str]] = {
    "fitted": "",
    "all_found": "all found",
    "none_found": "none found",
    "not_rising": "does not rise with size",
    "too_few": "too few sizes",
    "no_size": "has no size",
}

_CHECKS_SHOWN: Final = 3
_WRONG_SHOWN: Final = 30


@dataclass(frozen=True, slots=True)
class Share:
    """``count`` of ``of``, with its exact 95% interval (Clopper and Pearson); the interval of nothing is 0 to 1."""

    count: int
    of: int
    low: float
    high: float

    @property
    def value(self) -> float | None:
        """The share itself; None of nothing."""
        return self.count / self.of if self.of else None


@dataclass(frozen=True, slots=True)
class Estimate:
    """A magnitude with its 95% interval; a bound beyond what was tried is None."""

    value: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """The fitted probability of detection at one magnitude, with its 95% band."""

    magnitude: float
    probability: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Tried:
    """What was found of the faults within a half-open range of magnitudes."""

    least: float
    most: float
    found: Share


@dataclass(frozen=True, slots=True)
class Curve:
    """Detection probability against magnitude.

    ``fitted`` states whether there is a fit, or why not. ``separated``: some magnitude divides all that was found from
    all that was not, so that the likelihood alone would have no finite maximum, and the prior bounds the slope.
    ``at_50`` and ``at_95`` are the magnitudes found with these probabilities.
    """

    fitted: Fitted
    separated: bool
    at_50: Estimate
    at_95: Estimate
    points: tuple[CurvePoint, ...]


@dataclass(frozen=True, slots=True)
class Detection:
    """How well one check (or any, where ``check`` is empty) finds a cause planted in whole files, in ``unit``.

    ``material`` and ``material_curve`` count the found only where the deviation is material to a release; None in
    records made before they were counted.
    """

    cause: str
    unit: str
    check: str
    found: Share
    tried: tuple[Tried, ...]
    curve: Curve
    material: Share | None = None
    material_curve: Curve | None = None


@dataclass(frozen=True, slots=True)
class FalseAlarms:
    """Clean files with failed checks.

    ``upper`` bounds the rate with 95% confidence, one-sided; ``chance`` is the probability of as many or more if the
    ``stated`` rate is true.
    """

    files: Share
    upper: float
    stated: float
    chance: float
    by_check: Mapping[str, Share]


@dataclass(frozen=True, slots=True)
class Naming:
    """Of one kind of faults: how many were planted and found, and of those found how many had the right cause first.

    ``observable`` counts the found among those that the maker of the corpus expects to be detectable. Of composite
    faults any of the planted causes is right in the first place; ``all_named`` counts files all of whose causes were
    named, at any place.
    """

    kind: Kind
    found: Share
    observable: Share
    named_first: Share
    all_named: Share


@dataclass(frozen=True, slots=True)
class StatusAccuracy:
    """Of the diagnoses of one status, in faulty and clean files, how many name a cause that was planted.

    ``cause`` is its identifier, empty where all causes of the status count together.
    """

    status: DiagnosisStatus
    cause: str
    right: Share


@dataclass(frozen=True, slots=True)
class Confusion:
    """How often ``planted`` was called ``named``, several planted causes with a plus between."""

    kind: Kind
    planted: str
    named: str
    count: int


@dataclass(frozen=True, slots=True)
class MagnitudeError:
    """Fitted against true magnitudes of one cause, where it was named first and the units agree.

    A pull is (fitted - true) / standard error; ``pull_spread`` is 1.4826 times their median absolute value, which is 1
    where errors are Gaussian and correct. ``count`` faults have a fitted magnitude, ``with_error`` of them an error.
    """

    cause: str
    unit: str
    count: int
    median_relative_error: float
    with_error: int
    pull_median: float | None
    pull_spread: float | None
    within_two: Share


@dataclass(frozen=True, slots=True)
class StatedLimit:
    """Whether the ``least_detectable`` that a check states of a clean file is true of a cause.

    ``compared`` states how: by the planted size, which ``measurements`` measure, or by their response, what the fault
    moved them by. ``least``, ``median``, ``most`` are their stated limits over the clean files, in
    ``unit``. ``found_from_it`` counts faults of at least the limit stated of their own clean file, ``found_from_twice``
    those of at least twice that, both by this check; ``found_from_twice_by_any`` those by any check (None in
    records made before it was counted). ``worsened`` counts trials whose faulty file states more than twice the limit
    of its clean one (None in records made before they were counted rather than left out). ``at_50`` and
    ``at_95`` are sizes in units of that limit: ``at_95`` below 1/2 is too cautious by more than 2.
    """

    cause: str
    check: str
    compared: ComparedBy
    measurements: tuple[str, ...]
    unit: str
    least: float
    median: float
    most: float
    found_from_it: Share
    found_from_twice: Share
    curve: Curve
    truth: Truth
    found_from_twice_by_any: Share | None = None
    worsened: int | None = None


@dataclass(frozen=True, slots=True)
class NotComparable:
    """A check that finds a cause, and why no limit that it states can be compared with the fault's size."""

    cause: str
    check: str
    reason: str


@dataclass(frozen=True, slots=True)
class Power:
    """The whole study.

    ``estimators_digest`` identifies the code that was measured. ``crashed`` lists files in which a check did.
    ``set_aside`` counts faulty copies of clean files that failed themselves: what fails there may be the false alarm,
    so that they count in no table. ``statuses`` is empty in records made before it was counted.
    """

    power_version: str
    ruleset_version: str
    tool: Tool
    estimators_digest: str
    config_digest: str
    effort: str
    corpus: str
    started: str
    files: int
    clean: int
    crashed: tuple[str, ...]
    set_aside: int
    false_alarms: FalseAlarms
    naming: tuple[Naming, ...]
    detections: tuple[Detection, ...]
    confusions: tuple[Confusion, ...]
    magnitudes: tuple[MagnitudeError, ...]
    stated: tuple[StatedLimit, ...]
    not_comparable: tuple[NotComparable, ...]
    statuses: tuple[StatusAccuracy, ...] = ()


POWER: Final = DocumentKind(
    name="power",
    noun="a study",
    version=POWER_VERSION,
    adapter=TypeAdapter(Power),
    written_by="fedora-qa power --json",
    again="measure again with this version",
)


def tables_of(power: Power) -> tuple[TextTable, ...]:
    """Return the tables of a study that have rows."""
    false = power.false_alarms
    note = (
        f"One-sided 95% bound of the rate {false.upper:.2%}, stated rate {false.stated:.2g}. If that is true, as many "
        f"or more fail with probability {false.chance:.2g}."
    )
    if power.set_aside:
        note += f" {power.set_aside} faulty copies of files that failed are set aside, and not counted below."
    rows: list[tuple[str, ...]] = [(_ANY_CHECK, share_words(false.files), _interval_words(false.files))]
    rows += [(check, share_words(share), _interval_words(share)) for check, share in false.by_check.items()]
    alarms = TextTable("False alarms on clean files", ("check", "failed", "95% interval"), tuple(rows), note, words=1)

    head = ("faults", "found", "of those expected to be", "named first, of those found", "95% interval", "all named")
    rows = [
        (naming.kind, share_words(naming.found), share_words(naming.observable), share_words(naming.named_first),
         _interval_words(naming.named_first), share_words(naming.all_named))
        for naming in power.naming
    ]  # fmt: skip
    kinds = TextTable("Faults found and named", head, tuple(rows), words=1)

    rows = [
        (row.status, share_words(row.right), _interval_words(row.right))
        for row in power.statuses
        if not row.cause  # each cause is in the JSON
    ]
    statuses = TextTable(
        "Diagnoses that name a planted cause", ("status", "right", "95% interval"), tuple(rows), words=1
    )

    # Of several planted causes any is right in the first place; what was not found is a miss, not a wrong name.
    wrong = [
        confusion for confusion in power.confusions if confusion.named not in {NOT_FOUND, *confusion.planted.split("+")}
    ]
    wrong = sorted(wrong, key=lambda confusion: -confusion.count)
    rows = [
        (confusion.planted, confusion.named, confusion.kind, str(confusion.count)) for confusion in wrong[:_WRONG_SHOWN]
    ]
    more = len(wrong) - len(rows)
    note = f"And {more} more, in the JSON." if more else ""
    confusions = TextTable("Wrong names", ("planted", "named first", "kind", "files"), tuple(rows), note, words=3)

    head_of_sizes = (
        "cause", "files", "median relative error", "with error", "median pull", "spread of pulls", "within 2",
    )  # fmt: skip
    rows = [
        (error.cause, str(error.count), f"{error.median_relative_error:.1%}", str(error.with_error),
         "-" if error.pull_median is None else f"{error.pull_median:+.2f}",
         "-" if error.pull_spread is None else f"{error.pull_spread:.2f}",
         share_words(error.within_two) if error.with_error else "-")
        for error in power.magnitudes
    ]  # fmt: skip
    title = "Fitted sizes against planted ones, where the cause is named first"
    sizes = TextTable(title, head_of_sizes, tuple(rows), words=1)

    tables = (alarms, kinds, statuses, _detections(power), confusions, sizes, _limits(power))
    return tuple(candidate for candidate in tables if candidate.rows)


def headline(power: Power) -> str:
    """Return what was measured, in one line."""
    return f"{power.files} files of {power.corpus}, {power.clean} of them clean; effort {power.effort}"


def power_to_markdown(power: Power, drawing: str = "") -> str:
    """Return a study as a page: its headline, which code it belongs to, the ``drawing`` beside it, and its tables."""
    code = f"{power.tool.name} {power.tool.version}, rules {power.ruleset_version}, {power.started[:10]}"
    head = (
        f"# Detection power of the checks\n\n{escape(headline(power))}. {escape(code)}. "
        "How to read it: [power.md](power.md)."
    )
    crashed = (
        f"A check crashed in {len(power.crashed)} files: {escape(', '.join(power.crashed))}." if power.crashed else ""
    )
    picture = f"![Detection against size, and stated limits against measured ones]({drawing})" if drawing else ""
    sections = [table_section(source) for source in tables_of(power)]
    return "\n\n".join(section for section in [head, crashed, picture, *sections] if section) + "\n"


def share_words(share: Share) -> str:
    """Return ``59 of 60 (98%)``."""
    return f"{share.count} of {share.of}" + (f" ({share.value:.1%})" if share.value is not None else "")


def _interval_words(share: Share) -> str:
    """Return ``91.1% to 100.0%``."""
    return f"{share.low:.1%} to {share.high:.1%}"


def estimate_words(estimate: Estimate, unit: str = "") -> str:
    """Return ``2.1 (1.7 to 3.4) ms``; a question mark stands for a bound beyond what was tried."""
    if estimate.value is None:
        return "beyond what was tried"
    low, high = (number(_rounded(bound)) if bound is not None else "?" for bound in (estimate.low, estimate.high))
    suffix = f" {unit}" if unit not in {"", "1"} else ""
    return f"{number(_rounded(estimate.value))} ({low} to {high}){suffix}"


def curve_words(curve: Curve, unit: str = "") -> str:
    """Return the size that is found with 95% probability, or why it is unknown."""
    return estimate_words(curve.at_95, unit) if curve.fitted == "fitted" else _WHY_NO_FIT[curve.fitted]


def _rounded(value: float) -> float:
    # Three digits: the intervals beside these sizes are too wide for a fourth to mean anything.
    return float(f"{value:.3g}")


def _detections(power: Power) -> TextTable:
    rows: list[tuple[str, ...]] = []
    for _, group in groupby(power.detections, key=lambda detection: (detection.cause, detection.unit)):
        # First how often any check finds the cause, then the checks that find it most often.
        for detection in list(group)[: 1 + _CHECKS_SHOWN]:
            name = detection.cause if detection.check == WHOLE_FILE else ""
            rows.append(
                (
                    name,
                    detection.check or _ANY_CHECK,
                    share_words(detection.found),
                    curve_words(detection.curve, detection.unit),
                    "-" if detection.material is None else share_words(detection.material),
                    "-" if detection.material_curve is None else curve_words(detection.material_curve, detection.unit),
                )
            )
    head = ("cause", "check", "found", "found 95% of the time", "fails a release", "fails it 95% of the time")
    note = (
        "Faults of whole files; sizes with 95% intervals. Each cause has the checks that find it most often. A fault "
        "is found if its deviation is significant (profile strict). It fails a release if the deviation is also "
        "material (profile release)."
    )
    return TextTable("Detection", head, tuple(rows), note)


def _limits(power: Power) -> TextTable:
    head = ("cause", "check", "verdict", "compared by", "states (median)", "found from it on", "from twice it on",
            "95% at, of it")  # fmt: skip
    rows = [
        (limit.cause, limit.check, _TRUTH_WORDS[limit.truth], limit.compared,
         f"{number(_rounded(limit.median))} {limit.unit}", share_words(limit.found_from_it),
         share_words(limit.found_from_twice), curve_words(limit.curve))
        for limit in power.stated
    ]  # fmt: skip
    true = sum(limit.truth == "true" for limit in power.stated)
    # A limit near which too few faults were planted counts neither as true nor as false.
    tested = sum(limit.truth != "untested" for limit in power.stated)
    count, of = (sum(getattr(limit.found_from_twice, name) for limit in power.stated) for name in ("count", "of"))
    # None in older studies; what the check finds itself is then a lower bound.
    by_any = sum((limit.found_from_twice_by_any or limit.found_from_twice).count for limit in power.stated)
    note = (
        f"{true} of {tested} limits that could be tested are true: at least 90% of the faults are found from the "
        f"stated size on, and 95% are not reached below half of it. The stated limit is compared with the planted "
        f"size, or with the response, which is the effect of the fault on the measurement. From twice the stated "
        f"size on, the check that states it finds {count} of {of}, and any check {by_any}. "
        f"{len(power.not_comparable)} pairs of cause and check cannot be compared; the JSON has the reasons."
    )
    return TextTable("Limits that the checks state, against what they find", head, tuple(rows), note, words=4)
