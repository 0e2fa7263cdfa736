"""A study of detection as tables of text, the same in the terminal and in the report."""

from itertools import groupby
from typing import Final

from fedora_qa.record.markdown import escape, table_section
from fedora_qa.record.power_types import (
    NOT_FOUND,
    WHOLE_FILE,
    Curve,
    Estimate,
    Fitted,
    Power,
    Share,
    Truth,
)
from fedora_qa.record.tables import TextTable
from fedora_qa.record.wording import number

ANY_CHECK: Final = "any check"

TRUTH_WORDS: Final[dict[Truth, str]] = {
    "true": "true",
    "too_bold": "too bold",
    "too_cautious": "too cautious",
    "untested": "untested",
}

WHY_NO_FIT: Final[dict[Fitted, str]] = {
    "fitted": "",
    "all_found": "all found",
    "none_found": "none found",
    "not_rising": "does not rise with size",
    "too_few": "too few sizes",
    "no_size": "has no size",
}

_CHECKS_SHOWN: Final = 3
_WRONG_SHOWN: Final = 30


def tables_of(power: Power) -> tuple[TextTable, ...]:
    """Return the tables of a study that have rows."""
    false = power.false_alarms
    note = (
        f"One-sided 95% bound of the rate {false.upper:.2%}, stated rate {false.stated:.2g}. If that is true, as many "
        f"or more fail with probability {false.chance:.2g}."
    )
    if power.set_aside:
        note += f" {power.set_aside} faulty copies of files that failed are set aside, and not counted below."
    rows: list[tuple[str, ...]] = [(ANY_CHECK, share_words(false.files), interval_words(false.files))]
    rows += [(check, share_words(share), interval_words(share)) for check, share in false.by_check.items()]
    alarms = TextTable("False alarms on clean files", ("check", "failed", "95% interval"), tuple(rows), note, words=1)

    head = ("faults", "found", "of those expected to be", "named first, of those found", "95% interval", "all named")
    rows = [
        (naming.kind, share_words(naming.found), share_words(naming.observable), share_words(naming.named_first),
         interval_words(naming.named_first), share_words(naming.all_named))
        for naming in power.naming
    ]  # fmt: skip
    kinds = TextTable("Faults found and named", head, tuple(rows), words=1)

    rows = [
        (row.status, share_words(row.right), interval_words(row.right))
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


def interval_words(share: Share) -> str:
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
    return estimate_words(curve.at_95, unit) if curve.fitted == "fitted" else WHY_NO_FIT[curve.fitted]


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
                    detection.check or ANY_CHECK,
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
        (limit.cause, limit.check, TRUTH_WORDS[limit.truth], limit.compared,
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
