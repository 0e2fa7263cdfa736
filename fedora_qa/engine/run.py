"""Check one file from beginning to end, in this process."""

from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.engine.survey import survey_file
from fedora_qa.engine.tasks import measure_and_assemble
from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import Place
from fedora_qa.subjects.selection import select_checks

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
