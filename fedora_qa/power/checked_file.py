"""What a study stores of a checked file: the failed checks, their measurements, and the diagnoses."""

from collections.abc import Iterator
from dataclasses import dataclass

from fedora_qa.record.types import FileRecord, Side


@dataclass(frozen=True, slots=True)
class MeasuredDeviation:
    """One measurement: its deviation from what is expected, its limit, and its detection limit, all in ``unit``."""

    check: str
    name: str
    unit: str
    side: Side
    deviation: float
    limit: float | None
    least_detectable: float | None

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


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """One file after all checks.

    Attributes
    ----------
    failed, crashed
        Names of checks.
    measurements
        Of the checks that came to a verdict.
    diagnoses
        Most probable first.
    """

    sha256: str
    failed: tuple[str, ...]
    crashed: tuple[str, ...]
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
    """Return what a study stores of a record."""
    measurements = tuple(
        MeasuredDeviation(
            result.check,
            measurement.name,
            measurement.unit,
            measurement.side,
            measurement.value - measurement.expected,
            measurement.limit,
            measurement.least_detectable,
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
        measurements=measurements,
        diagnoses=tuple(
            NamedCause(
                f"{diagnosis.stream}:{diagnosis.cause}", diagnosis.magnitude, diagnosis.unit, diagnosis.standard_error
            )
            for diagnosis in file.diagnoses
        ),
    )
