"""What the passed checks of a file exclude: the detection limits in this very file, and what nobody could observe."""

from collections.abc import Sequence
from dataclasses import dataclass

from fedora_qa.record.types import Result
from fedora_qa.record.wording import least_detectable_text, number, with_unit
from fedora_reports.problems import Link


@dataclass(frozen=True, slots=True)
class CheckLimit:
    """A passed check, and the deviation of its first measurement from which it would have detected one, in words.

    ``more`` is the number of its other measurements with a limit.
    """

    check: Link
    limit: str
    more: int


@dataclass(frozen=True, slots=True)
class PassLimits:
    """The detection limits of the passed checks of a file.

    ``exact`` are passed checks whose values must be exact: any deviation counts. ``unobserved`` are checks without an
    answer, each with its reason.
    """

    rows: tuple[CheckLimit, ...]
    exact: tuple[Link, ...]
    unobserved: tuple[tuple[Link, str], ...]


def pass_limits_of(results: Sequence[Result], anchors: Sequence[str]) -> PassLimits | None:
    """Return what the passes of a file exclude; None where no check passed.

    Parameters
    ----------
    results
        The results of the file.
    anchors
        The identifier of each result on the page.
    """
    rows, exact, unobserved = list[CheckLimit](), list[Link](), list[tuple[Link, str]]()
    for result, anchor in zip(results, anchors, strict=True):
        link = Link(anchor, result.check)
        if result.outcome in {"not_observable", "crashed"}:
            unobserved.append((link, result.reason))
        if result.outcome != "passed":
            continue
        limits = []
        for measurement in result.measurements:
            least = measurement.least_detectable
            if least is not None and measurement.limit:
                unit = with_unit(least, measurement.unit).removeprefix(number(least))
                limits.append(f"{measurement.name} ≥ {least_detectable_text(measurement)}{unit}")
        if limits:
            rows.append(CheckLimit(link, limits[0], len(limits) - 1))
        elif any(measurement.limit == 0 for measurement in result.measurements):
            exact.append(link)
    return PassLimits(tuple(rows), tuple(exact), tuple(unobserved)) if rows or exact else None
