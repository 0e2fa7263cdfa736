"""The content of a record as text, shared by the terminal and by markdown, so that both agree."""

import math
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import Final

from fedora_qa.causes import CAUSES
from fedora_qa.record.types import (
    IMMATERIAL,
    Coverage,
    Diagnosis,
    DiagnosisStatus,
    FileRecord,
    Finding,
    Measurement,
    Outcome,
    Result,
    Where,
)

OUTCOME_WORDS: Final[dict[Outcome, str]] = {
    "failed": "failed",
    "crashed": "crashed",
    "warned": "warned",
    "passed": "passed",
    "not_observable": "not observable",
    "not_applicable": "not applicable",
}
"""Outcomes in words, the gravest first."""

NOT_RECOGNISED: Final = "layout not recognised"
"""Begins the reason of every result of a file of which no dialect describes anything."""


def not_recognised(path: object) -> str:
    """Return that no dialect describes anything in a file, a folder or an object behind a URL, and what to do."""
    kind = "folder" if isinstance(path, Path) and not path.is_file() else "file"
    return (
        f"{NOT_RECOGNISED}: no dialect describes anything in the {kind}; draft one with "
        f"`fedora-qa layout {quote(str(path))} --draft-dialect mine.toml`"
    )


SHORT_OF_COVERAGE: Final = "where the configuration requires"
"""Marks, in a result's reason, that its coverage is less than required."""

_COUNTED = {
    "chunks",
    "declarations",
    "events",
    "frames",
    "intervals",
    "labels",
    "pixels",
    "problems",
    "samples",
    "steps",
    "ticks",
}
"""Units that are plurals."""

# ECMA-48: control sequences (ESC [), operating system commands (ESC ], ended by BEL or ST), and other escapes.
_ESCAPE_SEQUENCE = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)?|[@-_])?")
_UNPRINTABLE = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
"""Unicode categories that could move the cursor, hide text or turn its direction."""


def printable(text: str) -> str:
    """Return text from a file as one harmless line: no escape sequences, no control or invisible characters."""
    plain = _ESCAPE_SEQUENCE.sub("", text)
    spaced = re.sub(r"[\t\r\n]+", " ", plain)
    return "".join("\N{REPLACEMENT CHARACTER}" if unicodedata.category(c) in _UNPRINTABLE else c for c in spaced)


def unobeyed(text: str) -> str:
    """Return printable text without the commands that a CI system executes in a log, wherever lines break.

    GitHub's runner executes ``::`` at the beginning of a line, behind spaces too, and ``##[`` anywhere in one
    (actions/runner, ActionCommand.cs).
    """
    # Twice: of three colons the first pass leaves two that follow each other.
    return printable(text).replace("::", ": :").replace("::", ": :").replace("##[", "## [")


def capitalised(text: str) -> str:
    """Return a text with a capital at its beginning; the rest stays as it is."""
    return f"{text[:1].upper()}{text[1:]}"


def number(value: float | None) -> str:
    """Return a number with four significant digits; integers in full."""
    if value is None:
        return "not a number"
    # Larger integers (counts of events, say) are rounded to four significant digits.
    if float(value).is_integer() and abs(value) < 1e7:
        return f"{value:.0f}"
    return f"{value:.4g}"


def with_unit(value: float | None, unit: str) -> str:
    """Return a number with its unit; ``"1"`` marks a pure number, and one of what is counted is singular."""
    if unit in {"", "1"}:
        return number(value)
    return f"{number(value)} {unit.removesuffix('s') if value == 1 and unit in _COUNTED else unit}"


def with_error(value: float | None, standard_error: float | None, unit: str) -> str:
    """Return ``2.06 ± 0.03 ms``: the error with two digits when it begins with 1 and one otherwise, the value alike."""
    if value is None or not standard_error:
        return with_unit(value, unit)
    exponent = math.floor(math.log10(standard_error))
    # An error of 1.4 rounded to 1 would be wrong by 29%; from 2 on, one digit is wrong by 20% at most.
    digits = 2 if standard_error < 2 * 10.0**exponent else 1
    decimals = digits - 1 - exponent
    suffix = f" {unit}" if unit not in {"", "1"} else ""
    largest = max(abs(value), standard_error)
    # Fixed notation would need more than six decimals, or more than seven digits before the point.
    if decimals > 6 or largest >= 1e7:
        return f"{value:.4g} ± {standard_error:.{digits}g}{suffix}"
    rounded, error = round(value, decimals) + 0.0, round(standard_error, decimals)  # + 0.0: no minus zero
    return f"{rounded:.{max(decimals, 0)}f} ± {error:.{max(decimals, 0)}f}{suffix}"


def place(where: Where) -> str:
    """Return where something is, in words; empty where nothing is known."""
    start_us, stop_us, row, stop = where.start_us, where.stop_us, where.index_start, where.index_stop
    times = rows = None
    if start_us is not None:
        times = f"at {_seconds(start_us)}"
        if stop_us is not None and stop_us != start_us:
            times = f"{_seconds(start_us)} to {_seconds(stop_us)}"
    if row is not None:
        # Half-open in the record; in a sentence the last row is included.
        rows = f"row {row}" if stop is None or stop - row == 1 else f"rows {row} to {stop - 1}"
    parts = [
        where.stream,
        times,
        rows,
        f"frame {where.frame}" if where.frame is not None else None,
        f"pixel ({where.pixel[0]}, {where.pixel[1]})" if where.pixel else None,
        "tile ({}, {}) to ({}, {})".format(*where.tile) if where.tile else None,
    ]
    return ", ".join(part for part in parts if part)


def headline(file: FileRecord) -> str:
    """Return the verdict and what it rests on, in one line."""
    return f"{file.verdict.upper()}: {tally(file.results)}"


def tally(results: Sequence[Result]) -> str:
    """Return how many checks had which outcome, the gravest first, and how many deviations are not material."""
    counts = Counter(result.outcome for result in results)
    parts = [f"{counts[outcome]} {word}" for outcome, word in OUTCOME_WORDS.items() if counts[outcome]]
    deviations = immaterial_count(results)
    more = f"; {deviations} measurable, not material" if deviations else ""
    return (", ".join(parts) or "no check was run") + more


def immaterial_count(results: Sequence[Result]) -> int:
    """Return how many deviations were measured that are not material."""
    return sum(finding.code == f"{result.check}.{IMMATERIAL}" for result in results for finding in result.findings)


def why_incomplete(file: FileRecord) -> str:
    """Return why the verdict is incomplete, in one sentence; empty where it is not."""
    if file.verdict != "incomplete":
        return ""
    reasons_given = {result.reason for result in file.results}
    if len(reasons_given) == 1 and (reason := reasons_given.pop()).startswith(NOT_RECOGNISED):
        return reason
    crashed = [result.check for result in file.results if result.outcome == "crashed"]
    short = [result.check for result in file.results if SHORT_OF_COVERAGE in result.reason]
    parts = [
        f"crashed: {', '.join(crashed)}" if crashed else "",
        f"less was seen than required: {', '.join(short)}" if short else "",
    ]
    if any(parts):
        return "; ".join(part for part in parts if part)
    if file.comparisons:
        return "no stream could be checked against another but by an index map, which repeats their stamps"
    return "no stream could be checked against another"


def basis_of_clean(file: FileRecord) -> str:
    """Return on how many comparisons of streams a clean verdict rests, and which it lacks; empty for any other."""
    if file.verdict != "clean" or file.comparisons is None:
        return ""
    plural = "" if file.comparisons == 1 else "s"
    basis = f"clean: rests on {file.comparisons or 'no'} comparison{plural} between streams"
    if not file.uncompared:
        return basis
    return f"{basis}; compared with no other stream: {', '.join(file.uncompared)}"


def canaries_seen(file: FileRecord) -> str:
    """Return how many checks detected the fault that was planted for them; empty without canaries."""
    if not file.canaries:
        return ""
    checks = {
        outcome: [canary.check for canary in file.canaries if canary.outcome == outcome]
        for outcome in ("seen", "withheld", "silent", "not_planted")
    }
    parts = [
        f"canaries seen by {len(checks['seen'])} of {len(file.canaries) - len(checks['not_planted'])} checks",
        f"not seen by {', '.join(checks['silent'])}" if checks["silent"] else "",
        f"no answer from {', '.join(checks['withheld'])}" if checks["withheld"] else "",
        f"none planted for {len(checks['not_planted'])}" if checks["not_planted"] else "",
    ]
    return "; ".join(part for part in parts if part)


def identity(file: FileRecord) -> str:
    """Return what identifies the file's content: dialect, size, digest."""
    digest = f"{'partial ' if file.digest_kind == 'partial' else ''}sha256 {file.sha256[:16]}"
    dialect = f"{file.dialect} layout, " if file.dialect else ""
    return f"{dialect}{file.size / 1e6:.1f} MB, {digest}"


def cause_sentence(diagnosis: Diagnosis) -> str:
    """Return the cause with its fitted size as one sentence."""
    cause = CAUSES.get(diagnosis.cause)
    meaning = cause.meaning if cause else diagnosis.cause.replace("_", " ")
    if diagnosis.magnitude is None:
        return f"{diagnosis.stream}: {meaning}"
    return f"{diagnosis.stream}: {meaning}, {with_error(diagnosis.magnitude, diagnosis.standard_error, diagnosis.unit)}"


def status_sentence(diagnosis: Diagnosis) -> str:
    """Return how a cause is known: ``confirmed: undoing it clears 5 of 5 findings in 4 windows``."""
    status, first = diagnosis.status, diagnosis.tried[:1]
    condition = f"with {' and '.join(diagnosis.after)} undone, " if diagnosis.after else ""
    if condition and not diagnosis.explains:
        return f"{status}: {condition}it appears, and undoing it clears that"
    if not first or not diagnosis.cleared:
        reasons: dict[DiagnosisStatus, str] = {
            "confirmed": "",
            "supported": "a check measures the cause itself, which cannot be undone",
            "suggested": "undoing it does not clear what it would explain" if first else "it fits, and was not tested",
            "unidentified": "no known cause fits",
        }
        return f"{status}: {reasons[status]}"
    of = len({*diagnosis.explains, *diagnosis.cleared})
    findings = "finding" if of == 1 else "findings"
    windows = f"{diagnosis.windows} window{'' if diagnosis.windows == 1 else 's'}"
    sentence = f"{status}: {condition}undoing it clears {len(diagnosis.cleared)} of {of} {findings} in {windows}"
    if rivals := diagnosis.tried[1:]:
        sentence += f"; so does this: {'; '.join(rivals)}"
    return sentence


def explained_checks(diagnosis: Diagnosis, file: FileRecord) -> tuple[str, ...]:
    """Return the checks whose findings the diagnosis explains, in the record's order."""
    explained = set(diagnosis.explains)
    return tuple(result.check for result in file.results if explained & {finding.id for finding in result.findings})


def findings_of(file: FileRecord) -> tuple[tuple[Result, Finding], ...]:
    """Return every finding with its result, failures before warnings."""
    pairs = [(result, finding) for result in file.results for finding in result.findings]
    # `sorted` is stable: within each group the order of the checks remains.
    return tuple(sorted(pairs, key=lambda pair: pair[1].severity in {"warning", "info"}))


def principal(result: Result) -> Measurement | None:
    """Return the measurement that lies farthest out, in multiples of what is allowed; the first among equals."""
    return max(result.measurements, key=_excess, default=None)


def check_cells(result: Result) -> tuple[str, str, str, str]:
    """Return the measured value, the expected one, the least detectable deviation, and the coverage.

    A check that was not observable, not applicable or crashed has only its coverage; its reason states why.
    """
    main, coverage = principal(result), coverage_words(result.coverage)
    if main is None or result.outcome in {"not_observable", "not_applicable", "crashed"}:
        return "", "", "", coverage
    more = f" (+{len(result.measurements) - 1})" if len(result.measurements) > 1 else ""
    return (
        f"{main.name} {with_error(main.value, main.standard_error, main.unit)}{more}",
        "" if main.expected is None else number(main.expected),
        least_detectable_text(main),
        coverage,
    )


def least_detectable_text(measurement: Measurement) -> str:
    """Return the least detectable deviation without its unit: a range where it depends on place or time."""
    if measurement.least_detectable is None:
        return ""
    if measurement.least_detectable_range is None:
        return number(measurement.least_detectable)
    return " to ".join(map(number, measurement.least_detectable_range))


def reasons(results: Sequence[Result]) -> tuple[str, ...]:
    """Return why checks have no outcome, or incomplete coverage; checks with the same reason together."""
    together: dict[tuple[str, str], list[str]] = {}
    for result in results:
        reason = result.reason
        # The warnings of a check are among its findings.
        if result.outcome == "warned":
            for finding in result.findings:
                reason = reason.removeprefix(finding.message).removeprefix("; ")
        if reason:
            together.setdefault((OUTCOME_WORDS[result.outcome], reason), []).append(result.check)
    return tuple(f"{', '.join(checks)} ({outcome}): {reason}" for (outcome, reason), checks in together.items())


def coverage_words(coverage: Coverage | None) -> str:
    """Return how much was measured: ``all 101 frames``, ``12 of 101 frames (11.9%)``."""
    if coverage is None:
        return ""
    if coverage.seen >= coverage.of:
        return f"all {coverage.of} {coverage.unit}"
    return f"{coverage.seen} of {coverage.of} {coverage.unit} ({100 * coverage.share:.3g}%)"


def _excess(measurement: Measurement) -> float:
    """Return how far a value lies out, in multiples of what is allowed; 0 on a side that does not count."""
    deviation = measurement.counted_deviation
    if deviation is None:
        # A value that could not be computed lies farthest out; without an expectation there is no deviation.
        return math.inf if measurement.value is None else 0.0
    if not measurement.allowed:
        # Nothing is allowed under an exact rule: any deviation breaks it.
        return math.inf if deviation else 0.0
    return deviation / measurement.allowed


def _seconds(time_us: float) -> str:
    """Return microseconds of the file's clock as seconds, without losing a microsecond."""
    # Six decimals of a second are the resolution of timestamps; `number` would round to four significant digits.
    return f"{time_us / 1e6:.6f}".rstrip("0").rstrip(".") + " s"
