"""The steps of a file, as a worker does them. ``FileTask`` refers to them by name."""

from dataclasses import replace

from fedora_qa.engine.file_task import FileTask, Sealed, Surveyed
from fedora_qa.engine.finish import finish_open
from fedora_qa.engine.open_file import OpenFile
from fedora_qa.engine.options import FileRun
from fedora_qa.engine.partial_pass import PartialPass, measure_open
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.run import asked_for
from fedora_qa.engine.survey import survey_file as surveyed_file
from fedora_qa.engine.whole import check_whole as whole_run
from fedora_qa.storage.place import Place


def check_whole(task: FileTask, open_file: OpenFile, progress: Progress) -> FileRun:
    """Check a file from beginning to end: arguments are the checks, None for what the options select, and options."""
    open_file.clear()
    checks, options = task.arguments
    place = _place(task)
    return whole_run(place, asked_for(checks, options), options, progress, open_file.opening(place))


def survey_file(task: FileTask, open_file: OpenFile, progress: Progress) -> Surveyed | FileRun:
    """Scan the timestamps of a file, arguments as above; its whole run where HDF5 refuses to open it."""
    open_file.clear()
    checks, options = task.arguments
    place = _place(task)
    surveyed = surveyed_file(place, asked_for(checks, options), options, progress, open_file.opening(place))
    return (
        surveyed
        if isinstance(surveyed, FileRun)
        else Surveyed(surveyed.path, len(surveyed.windows), Sealed.of(surveyed))
    )


def measure_windows(task: FileTask, open_file: OpenFile, progress: Progress) -> Sealed[PartialPass]:
    """Measure the windows of the task: the argument is the sealed pass over the windows just before them, or None.

    Returns the pass over both, sealed.
    """
    with open_file.opened(_surveyed(task)) as (survey, file):
        before = next(open_file.take_shown(*filter(None, task.arguments)), None)
        measured = measure_open(survey, file, task.windows, progress, before)
        # A file behind a URL is opened for each task alone, so that this counts no request twice.
        measured = replace(measured, traffic=measured.traffic + file.sequence.traffic)
        sealed = Sealed.of(measured, task.folder)
        open_file.keep_shown(sealed, measured)
        return sealed


def finish_file(task: FileTask, open_file: OpenFile, progress: Progress) -> FileRun:
    """Judge a file: arguments are the sealed passes over its batches of windows, in order, and the lost windows."""
    parts, lost = task.arguments
    with open_file.opened(_surveyed(task)) as (survey, file):
        # Blocks and images make place for the states of all workers, which are merged here.
        file.ready.forget()
        run = finish_open(survey, file, open_file.take_shown(*parts), lost, progress)
    open_file.clear()
    return run


def _place(task: FileTask) -> Place:
    if isinstance(task.subject, Surveyed):
        raise TypeError(f"Expected {task.function} of a place, got one of a survey")
    return task.subject


def _surveyed(task: FileTask) -> Surveyed:
    if not isinstance(task.subject, Surveyed):
        raise TypeError(f"Expected {task.function} of a survey, got one of a place")
    return task.subject
