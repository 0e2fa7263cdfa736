"""When a command began, for a budget of time: stored in click's context before the command is imported."""

from typing import Final

# Monotonic time in s: a correction of the wall clock must not shorten or lengthen a budget.
START_TIME: Final = "fedora_qa.began"
"""Key of the instant (``time.monotonic``) in ``click.Context.meta``."""
