"""How often an honest file may alarm where nobody says otherwise. Whoever needs only that loads nothing that judges."""

from typing import Final

DEFAULT_FALSE_ALARM_RATE: Final = 1e-4
"""A file, shared by all comparisons that are made on it."""
