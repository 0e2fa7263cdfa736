"""Every check, for tests that are run once for each."""

from typing import Any, Final

from fedora_qa.catalogue import all_checks
from fedora_qa.checks.protocol import Check

CHECKS: Final[tuple[Check[Any], ...]] = all_checks()
"""In the order in which they run."""
