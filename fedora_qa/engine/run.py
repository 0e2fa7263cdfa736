"""Check one file from beginning to end, in this process."""

from typing import Any

from fedora_qa.catalogue import CHECKS
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.engine.survey import survey_file
from fedora_qa.engine.tasks import measure_and_assemble
from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import Place

__all__ = ["CheckOptions", "FileRun", "check_file", "quiet", "select_checks"]


def check_file(path: Place, options: CheckOptions, progress: Progress = quiet) -> FileRun:
    """Check one file.

    Raises
    ------
    MisuseError
        There is no such file, it is not HDF5, or the options name an unknown check, or a budget of time, which
        only ``check_files`` supports.
    """
    if options.budget_s is not None:
        raise MisuseError("Expected check_files for a budget of time, got check_file, which takes what it takes")
    survey = survey_file(path, select_checks(options.select, options.ignore), options, progress)
    return survey if isinstance(survey, FileRun) else measure_and_assemble(survey, progress)


def select_checks(select: tuple[str, ...], ignore: tuple[str, ...]) -> tuple[Check[Any], ...]:
    """Return the checks that are asked for, in their fixed order.

    Raises
    ------
    MisuseError
        A name is that of no subject and no check.
    """
    selectable = {check.name for check in CHECKS} | {check.name.split(".")[0] for check in CHECKS}
    for name in (*select, *ignore):
        if name not in selectable:
            raise MisuseError(f"Expected a subject or check (see `fedora-qa checks`), got {name!r}")

    def named(check: Check[Any], names: tuple[str, ...]) -> bool:
        return check.name in names or check.name.split(".")[0] in names

    return tuple(check for check in CHECKS if (not select or named(check, select)) and not named(check, ignore))
