"""What a study stores of a checked file: the failed checks, their measurements, and the diagnoses."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

from fedora_qa.judgement.materiality import Materiality
from fedora_qa.record.types import DiagnosisStatus, FileRecord, Measurement, Result, Side


@dataclass(frozen=True, slots=True)
class MeasuredDeviation:
    """One measurement: its deviation from what is expected, its limit, and its detection limit, all in ``unit``.

    ``least_detectable_range`` is that of the most and of the least sensitive place or time, as in the record; None
    where all are alike, and in results that were stored before ranges were.
    """

    check: str
    name: str
    unit: str
    side: Side
    deviation: float
    limit: float | None
    least_detectable: float | None
    least_detectable_range: tuple[float, float] | None = None

    @property
    def stated_limits(self) -> tuple[float, float] | None:
        """The detection limits at the most and at the least sensitive place or time; None where none is stated.

        A fault of at least the higher one is detected wherever it is; one below the lower one is detected nowhere.
        """
        if not self.least_detectable:
            return None
        return self.least_detectable_range or (self.least_detectable, self.least_detectable)

    @property
    def exceeds(self) -> bool:
        """Whether the deviation is beyond its limit."""
        return self.limit is not None and self.harm(self.deviation) > self.limit

    def harm(self, deviation: float) -> float:
        """Return how far a deviation goes to the side that has a limit; negative on the other."""
        return {"both": abs(deviation), "upper": deviation, "lower": -deviation}[self.side]


@dataclass(frozen=True, slots=True)
class NamedCause:
    """A diagnosis, as far as a study needs it."""

    name: str
    """``stream:cause``."""
    magnitude: float | None
    unit: str
    standard_error: float | None
    status: DiagnosisStatus = "suggested"


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """One file after all checks.

    Attributes
    ----------
    failed, crashed
        Names of checks.
    material
        Names of failed checks with a deviation that is material to a release.
    measurements
        Of the checks that came to a verdict.
    diagnoses
        Most probable first.
    """

    sha256: str
    failed: tuple[str, ...]
    crashed: tuple[str, ...]
    material: tuple[str, ...]
    measurements: tuple[MeasuredDeviation, ...]
    diagnoses: tuple[NamedCause, ...]

    @property
    def is_found(self) -> bool:
        """Whether any check failed."""
        return bool(self.failed)

    @property
    def exceeded(self) -> Iterator[MeasuredDeviation]:
        """The measurements beyond their limits."""
        return (measurement for measurement in self.measurements if measurement.exceeds)


def checked_from(file: FileRecord) -> CheckedFile:
    """Return what a study stores of a record of the profile ``strict``."""
    duration_s = file.statistics.get("sequence", {}).get("duration_s")
    release = Materiality("release", duration_s if isinstance(duration_s, float) else 0.0)
    measurements = tuple(
        MeasuredDeviation(
            result.check,
            measurement.name,
            measurement.unit,
            measurement.side,
            measurement.value - measurement.expected,
            measurement.limit,
            measurement.least_detectable,
            measurement.least_detectable_range,
        )
        for result in file.results
        if result.outcome in {"passed", "warned", "failed"}
        for measurement in result.measurements
        if measurement.value is not None and measurement.expected is not None
    )
    return CheckedFile(
        sha256=file.sha256,
        failed=tuple(result.check for result in file.results if result.outcome == "failed"),
        crashed=tuple(result.check for result in file.results if result.outcome == "crashed"),
        material=tuple(result.check for result in file.results if _is_material(result, release)),
        measurements=measurements,
        diagnoses=tuple(
            NamedCause(
                f"{diagnosis.stream}:{diagnosis.cause}",
                diagnosis.magnitude,
                diagnosis.unit,
                diagnosis.standard_error,
                diagnosis.status,
            )
            for diagnosis in file.diagnoses
        ),
    )


def _is_material(result: Result, release: Materiality) -> bool:
    """Return whether a check failed by a deviation that exceeds its limit by a size that matters to a release."""
    return result.outcome == "failed" and any(
        _excess(m) > release.size(m.code, m.unit, m.expected or 0.0) for m in result.measurements
    )


def _excess(measurement: Measurement) -> float:
    """Return how far a deviation exceeds its limit, in the unit of the measurement; infinite where it is no number."""
    if measurement.value is None or measurement.expected is None or measurement.limit is None:
        return inf
    deviation = measurement.value - measurement.expected
    counted = {"both": abs(deviation), "upper": deviation, "lower": -deviation}[measurement.side]
    return counted - measurement.limit
