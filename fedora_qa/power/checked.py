"""What a study keeps of a checked file: which checks failed, what they had stated, and what was named."""

from dataclasses import dataclass

from fedora_qa.record.types import Diagnosis, FileRecord, Measurement, Result


@dataclass(frozen=True, slots=True)
class Reading:
    """One measurement: its deviation from what is expected, and the fault that it would surely have seen."""

    check: str
    name: str
    unit: str
    deviation: float
    least_detectable: float | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """A diagnosis, as far as a study needs it."""

    name: str
    """``stream:cause``."""
    magnitude: float | None
    unit: str
    standard_error: float | None


@dataclass(frozen=True, slots=True)
class Checked:
    """One file after all checks.

    Attributes
    ----------
    failed, crashed
        Names of checks.
    exceeded
        The readings beyond their limits.
    stated
        The readings of checks that passed or warned, of a clean file only: what the tool says it would have seen.
    diagnoses
        Most probable first.
    """

    sha256: str
    failed: tuple[str, ...]
    crashed: tuple[str, ...]
    exceeded: tuple[Reading, ...]
    stated: tuple[Reading, ...]
    diagnoses: tuple[Verdict, ...]

    @property
    def is_found(self) -> bool:
        """Whether any check failed."""
        return bool(self.failed)


def checked_from(file: FileRecord, *, clean: bool) -> Checked:
    """Return what is kept of a record; what was stated only of a clean file."""
    readings = [pair for result in file.results for pair in _readings(result)]
    answered = {result.check for result in file.results if result.outcome in {"passed", "warned", "failed"}}
    return Checked(
        sha256=file.sha256,
        failed=tuple(result.check for result in file.results if result.outcome == "failed"),
        crashed=tuple(result.check for result in file.results if result.outcome == "crashed"),
        exceeded=tuple(reading for reading, exceeds in readings if exceeds),
        stated=tuple(
            reading for reading, _ in readings if clean and reading.check in answered and reading.least_detectable
        ),
        diagnoses=tuple(_verdict(diagnosis) for diagnosis in file.diagnoses),
    )


def _readings(result: Result) -> list[tuple[Reading, bool]]:
    return [
        (Reading(result.check, one.name, one.unit, one.value - one.expected, one.least_detectable), _exceeds(one))
        for one in result.measurements
        if one.value is not None and one.expected is not None
    ]


def _exceeds(one: Measurement) -> bool:
    if one.value is None or one.expected is None or one.limit is None:
        return False
    difference = one.value - one.expected
    return {"both": abs(difference), "upper": difference, "lower": -difference}[one.side] > one.limit


def _verdict(diagnosis: Diagnosis) -> Verdict:
    name = f"{diagnosis.stream}:{diagnosis.cause}"
    return Verdict(name, diagnosis.magnitude, diagnosis.unit, diagnosis.standard_error)
