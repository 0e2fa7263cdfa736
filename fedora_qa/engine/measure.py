"""The measuring pass: every planned window handed to every check, in order; states that merge.

A pass over some windows gives a ``PassState``. Passes over neighbouring batches merge in order, and the result is the
same bit for bit however the windows were dealt out.
"""

import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol, TypeVar

from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.plan import FEWEST_FOLLOW_UPS, FOLLOW_UP_SHARE
from fedora_qa.engine.progress import MEASURING, Progress
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Sampling, Span, Window
from fedora_qa.storage.server import NO_TRAFFIC, Traffic

T = TypeVar("T")


class Accumulator(Protocol):
    """A check, or a collector of statistics or evidence, which gets the windows. ``Check`` documents each call."""

    name: str

    def start(self, facts: Facts) -> Any:
        """Return the state before any window."""
        ...

    def update(self, state: Any, window: Window) -> None:
        """Add a window to the state."""
        ...

    def merge(self, state: Any, later: Any) -> Any:
        """Return the state after the windows of both."""
        ...


@dataclass(slots=True)
class PassState:
    """The states of a pass by the name of the check, and what the pass cost.

    Attributes
    ----------
    missed
        Number of windows that a check could not measure because rows in them cannot be decoded.
    crashes
        Traceback of each check that failed itself.
    seconds
        Seconds of each check.
    measuring_s
        Seconds of the windows, in all processes together.
    decoded_bytes, traffic
        What was decoded for the windows, and requested of a server.
    """

    states: dict[str, Any]
    missed: dict[str, int] = field(default_factory=dict)
    crashes: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    measuring_s: float = 0.0
    decoded_bytes: int = 0
    traffic: Traffic = NO_TRAFFIC


def start(checks: Iterable[Accumulator], facts: Facts) -> PassState:
    """Return the states before any window.

    A check that fails on whether its question can be asked crashes here, where that is noted.
    """
    states = PassState({})
    for check in checks:
        if isinstance(check, Check):
            attempt(states, check.name, partial(check.not_applicable, facts))
        states.states[check.name] = attempt(states, check.name, partial(check.start, facts))
    return states


def attempt(states: PassState, name: str, call: Callable[[], T]) -> T | None:
    """Return the value of a call into a check; None after noting its crash, or where it has crashed before."""
    if name in states.crashes:
        return None
    try:
        return call()
    except Exception:  # noqa: BLE001 - a check that fails becomes an outcome, never the end of the run
        states.crashes[name] = traceback.format_exc()
        return None


def measure(
    checks: Sequence[Accumulator],
    spans: Sequence[Span],
    facts: Facts,
    decoder: BlockDecoder,
    sampling: Sampling,
    progress: Progress,
    audience: Callable[[Span], Sequence[Accumulator]] | None = None,
    states: PassState | None = None,
) -> PassState:
    """Hand each window to each check, or to those of them that are its ``audience``, in order of time.

    ``states`` are those after the windows before, and are extended; new ones where None.
    """
    states = states or start(checks, facts)
    began, decoded_before = time.perf_counter(), decoder.decoded_bytes
    for done, span in enumerate(spans):
        progress(MEASURING, done, len(spans))
        tasks = [(check.name, check.update) for check in (audience(span) if audience else checks)]
        _hand_out(decoder.window(span, facts, sampling), tasks, states)
    states.measuring_s += time.perf_counter() - began
    states.decoded_bytes += decoder.decoded_bytes - decoded_before
    return states


def follow_up(
    checks: Sequence[Check[Any]],
    states: PassState,
    spans: Sequence[Span],
    facts: Facts,
    decoder: BlockDecoder,
    sampling: Sampling,
    progress: Progress,
) -> int:
    """Hand the windows that checks name to them once more, a bounded share of all windows; return how many."""
    wanted: dict[str, tuple[int, ...]] = {}
    for check in checks:
        state = states.states.get(check.name)
        wanted[check.name] = attempt(states, check.name, partial(check.follow_up_windows, state, facts)) or ()
    budget = max(FEWEST_FOLLOW_UPS, int(FOLLOW_UP_SHARE * len(spans)))
    # Each check is granted its first window, then its second ..., until the budget is spent.
    granted: set[int] = set()
    longest = max((len(numbers) for numbers in wanted.values()), default=0)
    for turn in range(longest):
        for windows in wanted.values():
            # A window that several checks name counts once, as it is decoded once.
            if turn < len(windows) and len(granted) < budget:
                granted.add(windows[turn])
    by_index = {span.index: span for span in spans}
    # A check may name a lost window, which is not among the spans.
    numbers = sorted(granted & by_index.keys())
    for done, number in enumerate(numbers):
        progress("looking again", done, len(numbers))
        asking = [(check.name, check.follow_up) for check in checks if number in wanted[check.name]]
        _hand_out(decoder.window(by_index[number], facts, sampling), asking, states)
    return len(numbers)


def merge(checks: Iterable[Accumulator], earlier: PassState, later: PassState) -> PassState:
    """Return the states after the windows of both; those of checks that only one of them has as they are."""
    merged = PassState(
        states={},
        missed=_sums(earlier.missed, later.missed),
        # Of two crashes of a check the earlier one stays, as a single pass over all windows would have noted it.
        crashes={**later.crashes, **earlier.crashes},
        seconds=_sums(earlier.seconds, later.seconds),
        measuring_s=earlier.measuring_s + later.measuring_s,
        decoded_bytes=earlier.decoded_bytes + later.decoded_bytes,
        traffic=earlier.traffic + later.traffic,
    )
    for check in checks:
        states = [part.states[check.name] for part in (earlier, later) if check.name in part.states]
        if len(states) == 1:
            merged.states[check.name] = states[0]
        elif states:
            merged.states[check.name] = attempt(merged, check.name, partial(check.merge, *states))
    return merged


def merge_all(checks: Sequence[Accumulator], parts: Iterable[PassState], facts: Facts) -> PassState:
    """Merge passes over batches of windows, in the order of time: the same as one pass over all, bit for bit."""
    whole: PassState | None = None
    # Parts are loaded one at a time, so that memory holds the merged pass and one part.
    for part in parts:
        whole = merge(checks, whole, part) if whole else part
    whole = whole or PassState({})
    # Of some checks there may be no pass, where all their windows were lost.
    begun = start([check for check in checks if check.name not in whole.states], facts)
    whole.states |= begun.states
    whole.crashes |= begun.crashes
    return whole


def conclude(checks: Iterable[Check[Any]], states: PassState, facts: Facts) -> dict[str, Observation]:
    """Return the observation of each check that did not crash."""
    observations: dict[str, Observation] = {}
    for check in checks:
        state = states.states.get(check.name)
        observation = attempt(states, check.name, partial(check.conclude, state, facts))
        if observation is not None:
            observations[check.name] = observation
    return observations


def _hand_out(window: Window, tasks: Iterable[tuple[str, Callable[[Any, Window], None]]], states: PassState) -> None:
    for name, update in tasks:
        if name in states.crashes:
            continue
        began = time.perf_counter()
        try:
            update(states.states[name], window)
        except UnreadableRowsError:
            # Rows that cannot be decoded cost a check this window only; ``integrity.readable`` reports them.
            states.missed[name] = states.missed.get(name, 0) + 1
        except Exception:  # noqa: BLE001 - as in ``attempt``
            states.crashes[name] = traceback.format_exc()
        states.seconds[name] = states.seconds.get(name, 0.0) + time.perf_counter() - began


def _sums(earlier: dict[str, Any], later: dict[str, Any]) -> dict[str, Any]:
    return {name: earlier.get(name, 0) + later.get(name, 0) for name in {**earlier, **later}}
