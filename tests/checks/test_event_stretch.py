"""Stretches of frames: which frames are believed, and what the others measure."""

import numpy as np

from fedora_qa.checks.events.stretch import Ledger, Stretch
from fedora_qa.estimators.event_excursions import Excursions, bound
from fedora_qa.sequence.declared import EventModel

LEVELS = np.log(np.array([100.0, 100.0, 180.0, 100.0]))


def excursions(half_width: list[float]) -> Excursions:
    """Bounds of one silent pixel whose third frame alone shows 180 DN instead of 100."""
    level, width = (np.array(of_frames)[:, np.newaxis, np.newaxis] for of_frames in (LEVELS, half_width))
    silent = np.zeros((3, 2, 1, 1), np.int32)
    ends = {"threshold_on": 0.2, "threshold_off": 0.2, "frames": np.arange(4)}
    light, error = np.exp(level), np.exp(level) * np.expm1(width)  # of the upper end; the lower lies farther
    return bound(light, error, silent, np.zeros(3), **ends)[0]


def test_what_only_uneven_frames_contradict_is_their_flaw() -> None:
    """A frame that is not believed makes no violation; it counts how often antialiasing fails. A believed one does."""
    model = EventModel(model="log", threshold_on=0.2, threshold_off=0.2)
    believed, of_all = excursions([0.05, 0.05, np.inf, 0.05]), excursions([0.05] * 4)
    none, no_events = np.zeros((1, 1), np.bool_), np.zeros((1, 1), np.int64)
    for bounds, flawed in ((believed, 1), (of_all, 0)):
        ledger = Ledger(model)
        ledger.add(0, [Stretch(bounds, of_all, no_events, none)])
        (closed,) = ledger.closed()
        assert closed.flawed == flawed
        assert closed.unpacked((1, 1)).sum() == 1 - flawed
