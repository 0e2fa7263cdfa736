"""Which windows are looked at, and how densely, for each effort.

Efforts trade time for detection power. ``quick`` and ``standard`` sample windows evenly over the sequence, the first
and the last among them; ``full`` decodes every chunk and uses every event and sample, image tiles by a stated share;
``exhaustive`` uses every pixel.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from fedora_qa.sequence.window import Sampling

Effort = Literal["quick", "standard", "full", "exhaustive"]

_FEWEST_WINDOWS: Final = 4
"""A sample smaller than this cannot tell a local fault from a global one."""

FOLLOW_UP_SHARE: Final = 0.1
"""Share of the windows that checks may ask to see again."""


@dataclass(frozen=True, slots=True)
class EffortLevel:
    """Share of the windows, and of what lies in a window."""

    window_share: float
    sampling: Sampling


EFFORTS: Final[Mapping[Effort, EffortLevel]] = MappingProxyType(
    {
        "quick": EffortLevel(0.05, Sampling(tile_share=0.05, field_stride=4)),
        "standard": EffortLevel(0.25, Sampling(tile_share=0.1, field_stride=2)),
        "full": EffortLevel(1.0, Sampling(tile_share=0.25, field_stride=1)),
        "exhaustive": EffortLevel(1.0, Sampling(tile_share=1.0, field_stride=1)),
    }
)


@dataclass(frozen=True, slots=True)
class Plan:
    """The windows to look at, by their place in the list of spans, and how densely."""

    chosen: tuple[int, ...]
    of: int
    sampling: Sampling


def make_plan(effort: Effort, windows: int) -> Plan:
    """Choose windows for an effort, evenly spread over the sequence."""
    level = EFFORTS[effort]
    wanted = min(windows, max(_FEWEST_WINDOWS, int(np.ceil(level.window_share * windows))))
    chosen = np.unique(np.linspace(0, windows - 1, wanted).round().astype(int)) if windows else ()
    return Plan(tuple(int(i) for i in chosen), windows, level.sampling)
