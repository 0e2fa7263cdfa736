"""Flow vectors in other axes of the image: u and v exchanged, negated, or both."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class FlowAxes:
    """A signed permutation of u and v.

    Attributes
    ----------
    order
        Components that become u and v.
    signs
        Factor on each of both afterwards.
    """

    order: tuple[int, int]
    signs: tuple[int, int]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The (2, 2) matrix of the permutation."""
        return np.eye(2)[list(self.order)] * np.array(self.signs, dtype=np.float64)[:, np.newaxis]

    def of(self, flow: NDArray[Any]) -> NDArray[Any]:
        """Return flow (..., 2) with exchanged and negated components, in the same type."""
        return np.asarray(flow[..., self.order] * np.array(self.signs, dtype=flow.dtype))


FLOW_AXES: Final[Mapping[str, FlowAxes]] = MappingProxyType(
    {
        "negated": FlowAxes((0, 1), (-1, -1)),
        "transposed_axes": FlowAxes((1, 0), (1, 1)),
        "flipped_v": FlowAxes((0, 1), (1, -1)),
        "flipped_u": FlowAxes((0, 1), (-1, 1)),
        "quarter_turn": FlowAxes((1, 0), (-1, 1)),
        "quarter_turn_back": FlowAxes((1, 0), (1, -1)),
        "negated_transposed_axes": FlowAxes((1, 0), (-1, -1)),
    }
)
"""All signed permutations of two components but the identity, by the name of the transform."""
