"""What the faults that a check measures cost a learner, in words, for ``fedora-qa explain`` and reports."""

from collections.abc import Mapping
from itertools import groupby

from fedora_qa.scoring.fault_prices import FaultPrice, FaultPrices, read_fault_prices

TITLE = "Measured price"


def fault_price_text(check: str) -> str:
    """Return what each fault of a check was measured to cost, a fault a line; empty where none was measured."""
    prices = read_fault_prices()
    rows = prices.of(check) if prices else ()
    if prices is None or not rows:
        return ""
    lines = [
        f"{_fault_words(fault)}: {'; '.join(costs)}"
        for fault, costs in ((fault, _cost_words(list(of))) for fault, of in groupby(rows, key=_fault_of))
    ]
    return "\n".join([*lines, "", _source_sentence(prices)])


def fault_price_texts() -> Mapping[str, str]:
    """Return the text of every check that measures a fault whose price was measured."""
    prices = read_fault_prices()
    checks = dict.fromkeys(check for price in prices.prices for check in price.checks) if prices else {}
    return {check: fault_price_text(check) for check in checks}


def _fault_of(price: FaultPrice) -> tuple[str, float | None, str]:
    return price.fault, price.size, price.unit


def _fault_words(fault: tuple[str, float | None, str]) -> str:
    text, size, unit = fault
    return text if size is None else f"{text}, {size:g} {unit}"


def _cost_words(prices: list[FaultPrice]) -> list[str]:
    """Return the costs beyond the scatter of training; where there is none, the cost that would have been one."""
    costs = [
        f"{price.metric} {price.correct:.3f} + {price.cost:.3f} ({price.low:.3f} to {price.high:.3f})"
        for price in prices
        if price.leaves_noise
    ]
    bounds = "; ".join(f"{max(price.high, 0):.3f} in {price.metric}" for price in prices)
    return costs or [f"no cost beyond the scatter of training; at most {bounds}"]


def _source_sentence(prices: FaultPrices) -> str:
    return (
        f"A small network, trained on {prices.flights} generated flights with the fault and tested on correct ones: "
        f"{prices.networks} networks, {prices.correct_networks} on correct data (docs/learning.md, {prices.date})."
    )
