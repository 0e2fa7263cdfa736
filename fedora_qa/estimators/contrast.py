"""How sharp the image of warped events is, under a flow and under altered ones.

Events of one edge, carried along the true flow to one instant, meet in one line; carried otherwise they smear. The
sharpness is the mean, over events, of the density that they meet: the sum of squares of the image of warped events
over their number (G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization framework for event cameras,
CVPR (2018); mean square, as in G. Gallego, M. Gehrig, D. Scaramuzza, Focus is all you need, CVPR (2019)).

Events are carried to the middle of the interval, not to its start: in a flow that spreads, warping to one end lets all
events gather as the flow is overdone (S. Shiba, Y. Aoki, G. Gallego, Event collapse in contrast maximization
frameworks, Sensors 22 (2022)); to the middle those before it spread as those after it gather.

Events of one pixel are never of one place on an edge that moves: they meet best where nothing is carried, and would
draw every gain towards 0. What they contribute to the sum of squares is taken off; with votes that are nearly Gaussian
two of them that are d apart contribute exp(-d^2 / (4 s^2)) / (4 pi s^2).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.contrast_kernels import meetings_with_oneself, vote_warped

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

GAINS: Final = (0.5, 0.7, 0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25, 1.4, 2.0)
"""Gains that are tried for the best one, about evenly spread in their logarithm around 1."""

SIGMA_PX: Final = 1.0
"""Smoothing of the image of warped events, B-spline included."""

MARGIN_PX: Final = 12.0
"""Events farther from the border than this count however large the flow is."""

_SPLINE_VARIANCE_PX2: Final = 0.25

_MEMORY: Final = 16
"""Events of a pixel that later ones are held against; only pixels without cause fire more often."""


@dataclass(frozen=True, slots=True)
class WarpedEvents:
    """Sharpness under each candidate (k,), events carried, and the root mean square of their way (first field), px."""

    sharpness: Float64
    carried: int
    way_px: float


def sharpness_under(
    x: NDArray[np.uint16], y: NDArray[np.uint16], tau: Float64, candidates: Sequence[tuple[Float32, Float64]]
) -> WarpedEvents:
    """Carry the same events by every candidate: a flow (h, w, 2), px, and the matrix (2, 2) that it is multiplied by.

    ``tau`` is the events' instant in intervals of the flow after its start.
    """
    distinct = {id(flow_px): flow_px for flow_px, _ in candidates}
    places = {key: i for i, key in enumerate(distinct)}
    fields = np.stack(list(distinct.values())).astype(np.float32)
    which = np.array([places[id(flow_px)] for flow_px, _ in candidates], dtype=np.int64)
    turns = np.array([turn for _, turn in candidates], dtype=np.float64)
    height, width = fields.shape[1:3]
    images = np.zeros((len(candidates), height, width))
    margin = min(MARGIN_PX, min(height, width) / 4)
    carried = vote_warped(x, y, tau, fields, which, turns, margin, images)
    sigma = float(np.sqrt(SIGMA_PX**2 - _SPLINE_VARIANCE_PX2))
    smoothed = (cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) for image in images)
    squares = np.array([float(np.sum(np.square(image))) for image in smoothed])
    squares -= meetings_with_oneself(x, y, tau, fields, which, turns, margin, SIGMA_PX, _MEMORY)
    return WarpedEvents(squares / max(carried, 1), carried, _way_px(x, y, tau, fields[0]))


def _way_px(x: NDArray[np.uint16], y: NDArray[np.uint16], tau: Float64, flow_px: Float32) -> float:
    ways = np.hypot(flow_px[y, x, 0], flow_px[y, x, 1]) * np.abs(tau - 0.5)
    known = ways[np.isfinite(ways)]
    return float(np.sqrt(np.mean(np.square(known, dtype=np.float64)))) if len(known) else 0.0


def best_gain(sharpness: Float64) -> float:
    """Return the gain of the flow at which the sharpness (k,) under ``GAINS`` is largest.

    Between the gains, the parabola through the largest value and its neighbours in the logarithm of the gain tells. At
    the first and the last one the peak may lie beyond.
    """
    top = int(np.argmax(sharpness))
    if top in (0, len(GAINS) - 1):
        return GAINS[top]
    logs = np.log(GAINS)[top - 1 : top + 2]
    bend, slope, _ = np.polyfit(logs - logs[1], sharpness[top - 1 : top + 2], 2)
    step = -0.5 * slope / bend if bend < 0 else 0.0
    return float(np.exp(logs[1] + np.clip(step, logs[0] - logs[1], logs[2] - logs[1])))
