"""What the published studies measured of each check, in words, for ``fedora-qa explain`` and reports.

The detection power of a check is the size from which it finds a fault. The price of a fault is what it costs a learner.
"""

from collections.abc import Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Final

from fedora_qa.power.detection_power import DetectableCause as MeasuredCause
from fedora_qa.power.detection_power import DetectionPower, read_detection_power
from fedora_qa.record.power_study import estimate_words, share_words
from fedora_qa.scoring.fault_prices import read_fault_prices

if TYPE_CHECKING:
    from fedora_reports.detection_power import PassDetectionPower

_POWER_TITLE: Final = "Measured power"
PRICE_TITLE: Final = "Measured price"


def measured_sections(check: str) -> Mapping[str, str]:
    """Return the sections of an explanation that studies have measured, by title; those without text are left out."""
    sections = {_POWER_TITLE: detection_power_text(check), PRICE_TITLE: fault_price_text(check)}
    return {title: text for title, text in sections.items() if text}


def detection_power_text(check: str) -> str:
    """Return the causes that a check was measured to find, a cause a line; empty where no table is published."""
    detection_power = read_detection_power()
    if detection_power is None:
        return ""
    # Without the sentence a check that finds no cause reliably would look like one that was not measured.
    lines = [f"{row.cause}: {_share_or_size(row)}" for row in detection_power.of(check)] or [
        "No cause that was planted is found reliably by it."
    ]
    return "\n".join([*lines, "", _power_source(detection_power)])


def pass_detection_power() -> "PassDetectionPower":
    """Return the causes that each check can be relied on to find, as reports show them; none without a table."""
    # Reports import nothing but records: the measured power is handed over in their own types.
    from fedora_reports.detection_power import (  # noqa: PLC0415 - an extra
        NOTHING_KNOWN,
        DetectableCause,
        PassDetectionPower,
    )

    detection_power = read_detection_power()
    if detection_power is None:
        return NOTHING_KNOWN
    relied_on = [
        row for check in dict.fromkeys(row.check for row in detection_power.found) for row in detection_power.of(check)
    ]
    best: dict[str, MeasuredCause] = {}
    for row in relied_on:
        rival = best.setdefault(row.cause, row)
        # Strictly less: of equals the first check stays, so that the page is always the same.
        if _least(row) < _least(rival):
            best[row.cause] = row
    causes = (DetectableCause(row.cause, row.check, _share_or_size(row), best[row.cause] is row) for row in relied_on)
    by_cause = sorted(causes, key=lambda row: list(best).index(row.cause))
    return PassDetectionPower(tuple(by_cause), _power_source(detection_power))


def _least(row: MeasuredCause) -> float:
    """Return the least size that is found; 0 where every size that was tried is found, so that it comes first."""
    return 0.0 if row.at_95.value is None else row.at_95.value


def _share_or_size(row: MeasuredCause) -> str:
    if row.at_95.value is None:
        return f"found {share_words(row.found)}"
    return f"95% at {estimate_words(row.at_95, row.unit)}"


def _power_source(detection_power: DetectionPower) -> str:
    stale = " The code has changed since: make power measures it anew." if detection_power.is_stale() else ""
    files = f"{detection_power.files} short and small files, {detection_power.clean} of them clean"
    return f"Over {files} (fedora-qa power).{stale}"


def fault_price_text(check: str) -> str:
    """Return what each fault of a check was measured to cost, a fault a line; empty where no cost was measured.

    A cost within the scatter of training is left out: a small network that shows no cost does not prove that there is
    none.
    """
    prices = read_fault_prices()
    costly = [price for price in prices.of(check) if price.leaves_noise] if prices else []
    if prices is None or not costly:
        return ""
    lines = []
    for (fault, size, unit), of in groupby(costly, key=lambda price: (price.fault, price.size, price.unit)):
        # The error on correct data, the cost, and its interval, by measure.
        costs = (f"{p.metric} {p.correct:.3f} + {p.cost:.3f} ({p.low:.3f} to {p.high:.3f})" for p in of)
        lines.append(f"{fault if size is None else f'{fault}, {size:g} {unit}'}: {'; '.join(costs)}")
    source = (
        f"A small network, trained on {prices.flights} generated flights with the fault and tested on correct ones: "
        f"{prices.networks} networks, {prices.correct_networks} on correct data (docs/learning.md, {prices.date})."
    )
    return "\n".join([*lines, "", source])


def fault_price_texts() -> Mapping[str, str]:
    """Return the text of every check that measures a fault for which a cost was measured."""
    prices = read_fault_prices()
    checks = dict.fromkeys(check for price in prices.prices for check in price.checks) if prices else {}
    return {check: text for check in checks if (text := fault_price_text(check))}
