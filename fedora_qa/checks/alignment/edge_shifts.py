"""What the edge profiles of all windows tell of depth against colour, and against events."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.alignment.odd_one_out import PairShift
from fedora_qa.estimators.depth.edge_shift import EdgeShift, edge_shift
from fedora_qa.views.depth_edges import DepthEdges

CERTAIN: Final = 4.0
"""Standard errors by which a peak must stand out: chance gives one among 17 places in 5 of 10,000 pictures."""


@dataclass(frozen=True, slots=True)
class Edges:
    """Shifts of edges to the right and down; None where there are too few steps of depth."""

    right: EdgeShift | None
    down: EdgeShift | None

    @property
    def share(self) -> float:
        """Share of edge strength at the steps of depth, over both axes."""
        return sum(one.share for one in (self.right, self.down) if one is not None)

    @property
    def share_error(self) -> float:
        """Standard error of the share."""
        return float(np.sqrt(sum(one.share_error**2 for one in (self.right, self.down) if one is not None)))

    @property
    def certain(self) -> bool:
        """Whether edges stand out at the steps of depth at all."""
        return self.share > CERTAIN * self.share_error

    def pair(self, second: str) -> PairShift | None:
        """Return the shift against depth as a pair of cameras; an axis without edges has a boundless error."""
        if not self.certain:
            return None
        both = (self.right, self.down)
        shifts = [0.0 if one is None else one.shift_px for one in both]
        errors = [
            1e6 if one is None else float(np.hypot(one.standard_error_px, one.model_error_bound_px)) for one in both
        ]
        return PairShift("depth", second, np.array(shifts), np.array(errors))


def colour_edges(state: Sequence[DepthEdges]) -> tuple[Edges, ...]:
    """Return the edges of colour frames as stored, and of mirrored ones, as in ``VARIANTS``."""
    sums = np.array([one.colour for one in state])
    return tuple(Edges(*(edge_shift(sums[:, variant, axis]) for axis in (0, 1))) for variant in range(sums.shape[1]))


def event_edges(state: Sequence[DepthEdges]) -> Edges:
    """Return the edges that events show, in pixels of the event camera."""
    sums = np.array([one.events for one in state])
    return Edges(*(edge_shift(sums[:, axis]) for axis in (0, 1)))
