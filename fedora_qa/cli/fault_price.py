"""What the faults that a check measures cost a learner, in words, for ``fedora-qa explain`` and reports."""

from collections.abc import Iterable, Mapping
from itertools import groupby

from fedora_qa.scoring.fault_prices import FaultPrice, FaultPrices, read_fault_prices

TITLE = "Measured price"


def fault_price_text(check: str) -> str:
    """Return what each fault of a check was measured to cost, a fault a line; empty where no cost was measured.

    A cost within the scatter of training is left out: a small network that shows no cost does not prove that there is
    none.
    """
    prices = read_fault_prices()
    costly = [price for price in prices.of(check) if price.leaves_noise] if prices else []
    if prices is None or not costly:
        return ""
    lines = [f"{_fault_words(fault)}: {_cost_words(of)}" for fault, of in groupby(costly, key=_fault_of)]
    return "\n".join([*lines, "", _source_sentence(prices)])


def fault_price_texts() -> Mapping[str, str]:
    """Return the text of every check that measures a fault for which a cost was measured."""
    prices = read_fault_prices()
    checks = dict.fromkeys(check for price in prices.prices for check in price.checks) if prices else {}
    return {check: text for check in checks if (text := fault_price_text(check))}


def _fault_of(price: FaultPrice) -> tuple[str, float | None, str]:
    return price.fault, price.size, price.unit


def _fault_words(fault: tuple[str, float | None, str]) -> str:
    text, size, unit = fault
    return text if size is None else f"{text}, {size:g} {unit}"


def _cost_words(prices: Iterable[FaultPrice]) -> str:
    """Return the error on correct data, the cost, and its interval, by measure."""
    return "; ".join(
        f"{price.metric} {price.correct:.3f} + {price.cost:.3f} ({price.low:.3f} to {price.high:.3f})"
        for price in prices
    )


def _source_sentence(prices: FaultPrices) -> str:
    return (
        f"A small network, trained on {prices.flights} generated flights with the fault and tested on correct ones: "
        f"{prices.networks} networks, {prices.correct_networks} on correct data (docs/learning.md, {prices.date})."
    )
