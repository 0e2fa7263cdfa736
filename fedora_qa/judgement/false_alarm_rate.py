"""The default false-alarm rate. It stands in a module of its own, so that options load without the code that judges."""

from typing import Final

DEFAULT_FALSE_ALARM_RATE: Final = 1e-4
"""Probability that a correct file fails, shared by all comparisons of the file."""
