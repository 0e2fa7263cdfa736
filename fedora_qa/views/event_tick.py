"""The step of event timestamps."""

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.clocks.grid import crowded_step_ns
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import all_events


def local_tick_ns(window: Window) -> int:
    """Return the step of the event timestamps in a window, though a few events lie off the grid.

    Where nine events of ten share their timestamp with many others, the tick is the usual distance between such
    timestamps.
    """
    return window.derived(_local_tick_ns)


def _local_tick_ns(window: Window) -> int:
    return max(tick_ns(window.facts), crowded_step_ns(all_events(window).times_ns))


def tick_ns(facts: Facts) -> int:
    """Return the step of the event timestamps: the grid on which all of them lie, a microsecond at least."""
    declared = facts.declared.events
    packet_ns = declared.packet_interval_us * NS_PER_US if declared is not None else 0
    grid_ns = facts.events.grid_ns if facts.events is not None else 0
    # Timestamps in the file are whole microseconds: no tick can be finer.
    return max(NS_PER_US, packet_ns, grid_ns)
