"""Faults that befall all rates of flow alike are one fault of the flow."""

from collections.abc import Iterable, Set
from dataclasses import replace

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Statistic, Suspect


def over_all_rates(measured: Iterable[Statistic], rates: Set[str]) -> tuple[Statistic, ...]:
    """Let suspects name ``flow`` where the same cause is suspected in every one of several rates.

    Parameters
    ----------
    measured
        Each measurement with its suspects.
    rates
        The flow streams that could have been befallen.
    """
    measured = tuple(measured)
    found: dict[str, set[str]] = {}
    for suspect in (suspect for one in measured if one.value > 0 for suspect in one.suspects):
        found.setdefault(suspect.cause, set()).add(suspect.stream)
    common = {cause for cause, streams in found.items() if len(rates) > 1 and rates <= streams}
    return tuple(
        replace(one, suspects=tuple(_renamed(suspect, common) for suspect in one.suspects)) for one in measured
    )


def _renamed(suspect: Suspect, common: Set[str]) -> Suspect:
    family = stream_family(suspect.stream)
    return replace(suspect, stream=family) if family == "flow" and suspect.cause in common else suspect
