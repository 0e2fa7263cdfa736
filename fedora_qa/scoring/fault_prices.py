"""What faults in training data cost a small network, as measured and published.

The table is a file of the package, written by ``make study-learning``; docs/learning.md states how it was measured.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter

from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import read_published

PUBLISHED: Final = Path(__file__).with_name("fault_prices.json")


@dataclass(frozen=True, slots=True)
class FaultPrice:
    """The price of one fault in one error measure.

    Attributes
    ----------
    fault
        What is wrong with the data that are trained on, as a clause.
    cause
        ``stream:identifier``.
    size, unit
        None and empty where the fault has no size.
    checks
        The checks that measure it.
    metric
        The error measure: ``NAEE``, ``NADE``, ``NAE, position`` or ``NAE, orientation``.
    correct
        The mean error after training on correct data.
    cost, low, high
        By how much the fault makes it larger, with the simultaneous 95% interval over all faults.
    """

    fault: str
    cause: str
    size: float | None
    unit: str
    checks: tuple[str, ...]
    metric: str
    correct: float
    cost: float
    low: float
    high: float

    @property
    def leaves_noise(self) -> bool:
        """Whether the fault makes the error larger, beyond the scatter of training."""
        return self.low > 0


@dataclass(frozen=True, slots=True)
class FaultPrices:
    """The prices of a study: when it was made, of how many flights, and networks trained on each kind of data."""

    date: str
    flights: int
    networks: int
    correct_networks: int
    prices: tuple[FaultPrice, ...]

    def of(self, check: str) -> tuple[FaultPrice, ...]:
        """Return the prices of the faults that a check measures, in the order of the study."""
        return tuple(price for price in self.prices if check in price.checks)


_ADAPTER: Final = TypeAdapter(FaultPrices)


def write_fault_prices(prices: FaultPrices, target: Path = PUBLISHED) -> None:
    """Write the table, entirely or not at all."""
    write_text(target, _ADAPTER.dump_json(prices, indent=1).decode() + "\n")


def read_fault_prices(source: Path = PUBLISHED) -> FaultPrices | None:
    """Read the table; None where none has been published. Raises ``MisuseError`` where the file is damaged."""
    return read_published(source, _ADAPTER, "a table of the prices of faults", "run `make study-learning`")
