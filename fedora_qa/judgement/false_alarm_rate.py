"""How often a correct file may alarm by default: apart from what judges, so that options load without it."""

from typing import Final

DEFAULT_FALSE_ALARM_RATE: Final = 1e-4
"""A file, shared by all comparisons that are made on it."""
