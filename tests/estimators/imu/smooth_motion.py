"""Timestamps, even and uneven, and motions whose derivatives are known."""

import numpy as np
from numpy.typing import NDArray

TIMES_NS = np.arange(601) * 5_000_000
TIMES_S = TIMES_NS * 1e-9


def uneven_ns(count: int, seed: int = 0) -> NDArray[np.int64]:
    """Stamps that scatter by a fifth of a step."""
    return np.arange(count) * 5_000_000 + np.random.default_rng(seed).integers(-1000, 1000, count) * 1000


def polynomial(times_ns: NDArray[np.int64], coefficients: list[float]) -> NDArray[np.float64]:
    return np.polyval(coefficients, times_ns * 1e-9 - 1.5)[:, None] * [1.0, -0.5, 2.0]
