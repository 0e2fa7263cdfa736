"""The exit codes, the same for every command.

Where several apply, misuse precedes incomplete, and incomplete precedes findings.
"""

from collections.abc import Iterable
from typing import Final, Literal

from fedora_qa.record.types import FileRecord

CLEAN: Final = 0
FINDINGS: Final = 1
MISUSE: Final = 2
INCOMPLETE: Final = 3
INTERRUPTED: Final = 130
"""What shells report of a process that ctrl-C ended."""
OUTPUT_CLOSED: Final = 141
"""What shells report of a process whose reader went away."""


def exit_code(files: Iterable[FileRecord], fail_on: Literal["failed", "warned"]) -> int:
    """Return the exit code for the records of all files together."""
    files = tuple(files)
    # Incomplete before findings: the check that crashed might have added more of them.
    if any(
        (file.verdict == "incomplete" or any(result.outcome == "crashed" for result in file.results)) for file in files
    ):
        return INCOMPLETE
    # Outcomes count here, not the verdict: `--fail-on warned` also counts warnings, which leave a verdict clean.
    grave = {"failed"} if fail_on == "failed" else {"failed", "warned"}
    has_grave = any(result.outcome in grave for file in files for result in file.results)
    return FINDINGS if has_grave else CLEAN
