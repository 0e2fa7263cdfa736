"""When a command began, for a budget of time: told through click's context, before the command is imported."""

from typing import Final

BEGAN: Final = "fedora_qa.began"
"""Key of the instant (``time.monotonic``) in ``click.Context.meta``."""
