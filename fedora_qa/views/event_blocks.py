"""How frames and events have changed over blocks of pixels, shared by the checks of orientation and of frames."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.block_means import add_events_beyond, event_blocks, level_blocks
from fedora_qa.estimators.events.orientation import ChangeMoments, implied_moments, span_moments, step_moments
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import ResampledFrames, resampled_frames, signal_of
from fedora_qa.views.sensor_events import GRID, all_events, sensor_events, sensor_shape

Float64 = NDArray[np.float64]

_GRID_PIXELS: Final = 40
"""Most pixels along each axis whose levels are kept: a share of 1,600 has an error of 1.3% at most."""

NOMINAL_RESPONSE: Final = EventModel("log", 0.5, 0.5)
"""Response of a sensor that declares none, for correlations, which do not depend on the scale of the events. Thresholds
of event cameras lie between 0.1 and 0.5 nat (G. Gallego et al., IEEE TPAMI 44 (2022), section 2.3); the largest leaves
changes most uncertain."""


@dataclass(frozen=True, slots=True)
class BlockMoments:
    """Moments of frames (n,) and the events between them.

    Attributes
    ----------
    frames
        (n,) rows.
    steps
        (n - 1, t, 8, 6) moments between successive frames, by tile of the image, under the eight symmetries.
    span
        Moments between the first frame and the last, of the whole image.
    implied
        Moments between the first frame and the last, with the events that the frames imply (``implied_moments``).
    levels
        (3, k) signal of some pixels that are spread evenly over the image: in the first frame, and its least and
        greatest value in any; NaN where it is not known in all frames.
    """

    frames: NDArray[np.int64]
    steps: NDArray[np.float64]
    span: ChangeMoments
    implied: ChangeMoments
    levels: NDArray[np.float64]


def block_moments(window: Window) -> BlockMoments | None:
    """Return the moments of a window's frames and the next one; None where there are not two.

    Events of a sensor without a declared response have that of ``NOMINAL_RESPONSE``.
    """
    return window.derived(_block_moments)


def _block_moments(window: Window) -> BlockMoments | None:
    resampled, response = resampled_frames(window), window.facts.declared.events or NOMINAL_RESPONSE
    if len(resampled) < 2:
        return None
    levels = np.stack([window.derived_image(_level_blocks, int(frame)) for frame in resampled.frames])
    events = event_blocks(resampled.counts, response.threshold_on, response.threshold_off)
    stored = all_events(window)
    if len(stored) > len(sensor_events(window)):
        shape = sensor_shape(window.facts.declared)
        columns = stored.x, stored.y, stored.times_ns, stored.p
        # Exchanged axes put events outside of the declared sensor: without these, that symmetry would lack events.
        add_events_beyond(events, *columns, resampled.times_ns, shape, response.threshold_on, response.threshold_off)
    steps = step_moments(levels, events, GRID)
    # Between two frames there is but one step.
    span = ChangeMoments(steps[0].sum(axis=0)) if len(steps) == 1 else span_moments(levels, events)
    stride = -(-max(resampled.error_dn.shape[1:]) // _GRID_PIXELS)
    of_grid = np.stack([_known_signal(resampled, response, number, stride) for number in range(len(resampled))])
    extremes = np.stack([of_grid[0], of_grid.min(axis=0), of_grid.max(axis=0)]).reshape(3, -1)
    change = _known_signal(resampled, response, len(resampled) - 1) - _known_signal(resampled, response, 0)
    implied = implied_moments(change, response.threshold_on, response.threshold_off)
    return BlockMoments(resampled.frames, steps, span, implied, extremes)


def _known_signal(
    resampled: ResampledFrames, response: EventModel, number: int, stride: int = 1
) -> NDArray[np.float32]:
    """Return the signal of a frame at every ``stride``-th pixel along both axes; NaN where it is not known."""
    levels, lit = signal_of(resampled, response, number, stride)
    return np.where(lit, levels, np.float32(np.nan))


def _level_blocks(window: Window, frame: int) -> NDArray[np.float64]:
    """Return the means of the signal of one of the window's frames over blocks."""
    resampled, response = resampled_frames(window), window.facts.declared.events or NOMINAL_RESPONSE
    dark_dn = None if response.model == "linear" else response.log_eps_dn
    number = int(np.searchsorted(resampled.frames, frame))
    return level_blocks(resampled.uniform_dn[number], resampled.error_dn[number], dark_dn)
