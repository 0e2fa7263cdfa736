"""Check one file from beginning to end in one process, so that follow-ups find blocks that are still decoded."""

from contextlib import AbstractContextManager
from typing import Any

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.finish import finish_open
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.partial_pass import measure_open
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.survey import opened, survey_file
from fedora_qa.storage.place import Place


def check_whole(
    path: Place,
    checks: tuple[Check[Any], ...],
    options: CheckOptions,
    progress: Progress,
    opening: AbstractContextManager[None] | None = None,
) -> FileRun:
    """Survey a file, measure all windows of its plan, and judge it; ``opening`` is entered while it is first opened."""
    survey = survey_file(path, checks, options, progress, opening)
    if isinstance(survey, FileRun):
        return survey
    with opened(survey) as file:
        measured = measure_open(survey, file, range(len(survey.windows)), progress)
        return finish_open(survey, file, [measured], [], progress)
