"""Paths of every shape that a picture must hold."""

from typing import Any

import numpy as np

Arrays = dict[str, Any]

_TIMES_S = np.linspace(0.0, 10.0, 401)
_ZERO = np.zeros_like(_TIMES_S)


def flown(positions_world_m: Any) -> Arrays:
    """Return the arguments of ``render_trajectory`` for a body that looks where it flies."""
    places = np.asarray(positions_world_m, dtype=np.float64)
    rates = np.gradient(places, _TIMES_S[1], axis=0) if len(places) > 1 else np.ones_like(places)
    speeds = np.linalg.norm(rates, axis=1)
    forward = rates / np.maximum(speeds, 1e-9)[:, None]
    return {
        "times_us": np.arange(len(places)) * 25_000.0,
        "positions_world_m": places,
        "speeds_m_s": speeds,
        "forward_world": forward,
    }


def loop() -> Arrays:
    """Twice around at changing heights, at changing speeds."""
    angles = 0.6 * _TIMES_S + 0.2 * np.sin(_TIMES_S)
    return flown(np.stack([20 * np.cos(angles), 14 * np.sin(angles), 5 + 2 * np.sin(2 * angles)], axis=1))


def with_gaps() -> Arrays:
    """A loop whose positions, speeds and directions are missing here and there."""
    arrays = loop()
    arrays["positions_world_m"][[100, 101, 102, 200]] = np.nan
    arrays["speeds_m_s"][50:60] = np.nan
    arrays["forward_world"][:] = np.nan
    return arrays


SHAPES = {
    "straight": flown(np.stack([5 * _TIMES_S, _ZERO, _ZERO + 2], axis=1)),
    "a kilometre": flown(np.stack([1e5 + 70 * _TIMES_S, -70 * _TIMES_S, _ZERO + 30], axis=1)),
    "loop": loop(),
    "gaps": with_gaps(),
    "hover": flown(np.stack([12 + 1e-3 * np.sin(_TIMES_S), 3 + 2e-3 * np.cos(3 * _TIMES_S), _ZERO + 1.5], axis=1)),
    "vertical": flown(np.stack([_ZERO, _ZERO, 3 * _TIMES_S], axis=1)),
    "still": flown(np.tile([1.0, 2.0, 3.0], (401, 1))),
    "two poses": flown([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]]),
    "one pose": flown([[1.0, 2.0, 3.0]]),
}
