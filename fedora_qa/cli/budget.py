"""``--budget``: how long a check may take, and what the record says of it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import click

from fedora_qa.config import CheckConfig
from fedora_qa.errors import MisuseError
from fedora_qa.record.types import Record

_SECONDS_PER_UNIT: Final[Mapping[str, float]] = {"s": 1.0, "m": 60.0, "h": 3600.0}


@dataclass(frozen=True, slots=True)
class Budget:
    """An amount of time, as it was given and in seconds."""

    text: str
    seconds: float


class BudgetParam(click.ParamType):  # type: ignore[type-arg]  # generic only from click 8.4 on
    """Turns an amount such as ``60s`` into a budget; raises ``MisuseError``."""

    name = "time"

    def convert(self, value: str | Budget, param: click.Parameter | None, ctx: click.Context | None) -> Budget:
        """Return the budget that the text means."""
        return parse_budget(value) if isinstance(value, str) else value


def parse_budget(text: str) -> Budget:
    """Return an amount of time such as ``60s``, ``5m`` or ``0.5h``; raises ``MisuseError``."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([smh])\s*", text.lower())
    seconds = float(match[1]) * _SECONDS_PER_UNIT[match[2]] if match else 0.0
    # 0s is refused like text that does not match: no window fits into it.
    if seconds <= 0:
        raise MisuseError(f"Expected a time with a unit, such as 60s, 5m or 0.5h, got {text!r}")
    return Budget(text.strip(), seconds)


def require_budget_alone(budget: Budget | None, effort: str | None, settings: CheckConfig) -> None:
    """Raise ``MisuseError`` where a budget is combined with an effort or with canaries."""
    if budget and effort:
        raise MisuseError("Expected either --effort or --budget, got both")
    if budget and settings.canary:
        raise MisuseError("Expected no canaries with --budget: how long they take is not known before; leave one out")


def budgeted(record: Record, budget: Budget) -> Record:
    """Return the record with the budget among the facts of its run: results depend on it, and on the machine."""
    # In `run`, whose facts do not make two records differ: how far a budget carries depends on the machine.
    host = {**record.run.host, "budget_s": budget.seconds}
    return replace(record, run=replace(record.run, host=host), effort=f"budget {budget.text}")
