"""The step of event timestamps."""

from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.events.timestamp_kernels import are_crowded
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events, Window
from fedora_qa.views.event_camera import all_events

_CROWD: Final = 8
"""Events at one stamp, and such stamps in a window, from which on they are no coincidence."""

_MOST_CROWDED: Final = 0.9
"""Share of the events that lie at such stamps, where stamps have a tick of their own."""


def local_tick_ns(window: Window) -> int:
    """Return the step of the event stamps in a window, though a few events lie off the grid.

    Where nine events of ten share their stamp with many others, the usual distance of those stamps is the tick.
    """
    return window.once("local_tick_ns", lambda: max(tick_ns(window.facts), _crowded_step_ns(all_events(window))))


def _crowded_step_ns(events: Events) -> int:
    times_ns = events.times_ns
    if not are_crowded(times_ns, _CROWD, _MOST_CROWDED):
        return 0
    first = np.flatnonzero(np.diff(times_ns, prepend=times_ns[:1] - 1))
    counts = np.diff(first, append=len(times_ns))
    crowded = counts >= max(_CROWD, 0.1 * float(counts.max(initial=0)))
    if np.count_nonzero(crowded) < _CROWD or counts[crowded].sum() < _MOST_CROWDED * len(times_ns):
        return 0
    return int(np.median(np.diff(times_ns[first[crowded]])))


def tick_ns(facts: Facts) -> int:
    """Return the step of the event stamps: the grid on which all of them lie, a microsecond at least."""
    declared = facts.declared.events
    packet_ns = declared.packet_interval_us * NS_PER_US if declared is not None else 0
    grid_ns = facts.events.grid_ns if facts.events is not None else 0
    return max(NS_PER_US, packet_ns, grid_ns)
