"""The units that timestamps are written in by mistake, as factors of a duration."""

from typing import Final

UNIT_FACTORS: Final = {
    1e-6: "are in seconds",
    1e-3: "are in milliseconds",
    1.0: "agree with the other streams",
    32.0: "are wall-clock time of a simulation that ran 32 times slower",
    1e3: "are in nanoseconds",
}
"""Meaning of the ratio of a stream's duration to that of the others, for the mistakes that occur in real files."""

UNIT_WITHIN: Final = 0.2
"""Largest relative difference from a factor. Durations farther from all factors are streams that end early
(clocks.span)."""


def unit_factor(ratio: float) -> float:
    """Return the first factor of ``UNIT_FACTORS`` that a ratio of durations is near to; 1 where there is none.

    Near means a relative difference of ``UNIT_WITHIN`` at most.
    """
    return next((factor for factor in UNIT_FACTORS if abs(ratio / factor - 1) <= UNIT_WITHIN), 1.0)
