"""The results of a study of detection. Field names are relied on by others and never change within a version.

A cause is written ``stream:identifier``. Magnitudes are sizes: positive, whatever the sign of the planted fault. Values
that are unknown, or beyond the sizes of the trials, are None.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from pydantic import TypeAdapter

from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.types import DiagnosisStatus, Tool

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
