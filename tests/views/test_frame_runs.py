"""Stretches of frames: which frames are believed, and what the others measure."""

import numpy as np

from fedora_qa.estimators.events.excursions import EVERY_FRAME, ConservationLaw, Excursions, bound
from fedora_qa.sequence.declared import EventModel
from fedora_qa.views.frame_runs import FrameRun, FrameRuns

LEVELS = np.log(np.array([100.0, 100.0, 180.0, 100.0]))


def excursions(believed: tuple[float, float]) -> Excursions:
    """Bounds of one silent pixel whose third frame alone shows 180 DN instead of 100, and is the least even one."""
    light = np.exp(LEVELS)[:, np.newaxis, np.newaxis]
    error = light * np.expm1(np.array([0.05, 0.05, 0.06, 0.05]))[:, np.newaxis, np.newaxis]
    silent = np.zeros((3, 2, 1, 1), np.int32)
    law = ConservationLaw(0.2, 0.2, uneven=(believed, EVERY_FRAME))
    return bound(light, error, silent, np.zeros(3), law, np.arange(4))


def test_what_only_uneven_frames_contradict_is_their_flaw() -> None:
    """A frame that is not believed makes no violation; it counts how often antialiasing fails. A believed one does."""
    model = EventModel(model="log", threshold_on=0.2, threshold_off=0.2)
    none, no_events = np.zeros((1, 1), np.bool_), np.zeros((1, 1), np.int32)
    for believed, flawed in (((0.0, 0.055), 1), (EVERY_FRAME, 0)):
        runs = FrameRuns(model)
        runs.add(0, [FrameRun(excursions(believed), no_events, none)])
        (summary,) = runs.summaries()
        assert summary.flawed == flawed
        assert summary.unpacked((1, 1)).sum() == 1 - flawed
