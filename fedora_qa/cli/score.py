"""``fedora-qa score``: what a learner predicts against the truth of a sequence."""

from pathlib import Path

from fedora_qa.cli.console import print_table, text
from fedora_qa.cli.documents import write_document
from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.settings import external_folders
from fedora_qa.engine.executors.executor import Task, Worker, opening_test
from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import DialectChoice, load_choice
from fedora_qa.scoring.predictions import PredictionsForm
from fedora_qa.scoring.score import score_sequence
from fedora_qa.scoring.tables import headline, score_tables, score_to_markdown
from fedora_qa.scoring.types import SCORE, Score
from fedora_qa.storage.folder import is_folder
from fedora_qa.storage.signature import require_signature


def run_score(
    predictions: Path,
    sequence: Path,
    form: PredictionsForm | None,
    dialect: str | None,
    metadata: str | None,
    allow_external: tuple[str, ...],
    outputs: Outputs,
) -> int:
    """Run the command and return its exit code."""
    choice, folders = load_choice(dialect, metadata), external_folders(allow_external)
    require_readable(predictions, sequence)
    outputs.require_writable([predictions, sequence])
    score = scored_isolated(predictions, sequence, form, choice, folders)
    if outputs.json:
        write_document(outputs.json, SCORE.to_json(score))
    if outputs.markdown:
        write_document(outputs.markdown, score_to_markdown(score))
    if outputs.html:
        from fedora_reports.score import render_score  # noqa: PLC0415 - an extra

        write_document(outputs.html, render_score(score))
    console = outputs.console()
    for table in score_tables(score):
        print_table(console, table)
    for note in score.notes:
        console.print(text(note, "yellow"))
    console.print(text(headline(score), "bold"))
    return CLEAN


def require_readable(predictions: Path, sequence: Path) -> None:
    """Raise ``MisuseError`` before any work where a path is missing, or is neither HDF5 nor a folder."""
    for path, what in ((predictions, "predictions"), (sequence, "a sequence")):
        if not (path.exists() or is_folder(path)):
            raise MisuseError(f"Expected {what}, got a path that does not exist: {path}")
        if not is_folder(path):
            require_signature(path)


def scored_isolated(
    predictions: Path,
    sequence: Path,
    form: PredictionsForm | None,
    choice: DialectChoice,
    folders: tuple[Path, ...],
    *,
    in_process: bool = False,
) -> Score:
    """Score in a process of its own, as ``run_isolated`` does; raises as ``score_sequence``."""
    files = [opening_test(predictions)] if predictions.is_file() else []
    files.append(opening_test(sequence, choice, folders))
    tests = [test for test in files if test is not None]
    opening = Task(_open_each, (tests,), limit_s=sum(test.limit_s or 0.0 for test in tests))
    task = Task(_score, (predictions, sequence, form, choice, folders))
    with progress_bar(sequence.name) as bar:
        score: Score = run_isolated(task, f"{predictions} or {sequence}", opening, bar, in_process=in_process)
    return score


def _open_each(tests: list[Task], worker: Worker) -> None:
    for test in tests:
        test.do(worker)


def _score(
    predictions: Path,
    sequence: Path,
    form: PredictionsForm | None,
    choice: DialectChoice,
    folders: tuple[Path, ...],
    worker: Worker,
) -> Score:
    return score_sequence(predictions, sequence, form, choice, folders, worker.progress)
