"""``fedora-qa extract``: the smallest file that shows a finding, to be sent to somebody."""

from pathlib import Path
from typing import Any, get_args

import click

from fedora_qa.cli.exit_codes import CLEAN, INCOMPLETE
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.outputs import require_new_file
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.sequences import require_one_sequence
from fedora_qa.cli.settings import check_options, settings_from
from fedora_qa.engine.executors.executor import CHECK_WHOLE, Task, Worker, opening_test
from fedora_qa.engine.options import CheckOptions, Effort
from fedora_qa.errors import MisuseError, UnreadableFileError
from fedora_qa.extract.extract import CheckFinding, Extraction
from fedora_qa.extract.extract import extract as extract_piece
from fedora_qa.judgement.materiality import PROFILES
from fedora_qa.record.atomic import staging_path
from fedora_qa.record.json_io import read_record
from fedora_qa.record.types import FileRecord, Record
from fedora_qa.record.wording import unobeyed
from fedora_qa.storage.digest import file_digest
from fedora_qa.storage.folder import local_version


def run_extract(
    file: Path,
    finding: str,
    output: Path,
    record_path: Path | None,
    longest_s: float,
    config: Path | None,
    force: bool,
    **overrides: Any,
) -> int:
    """Run the command and return its exit code."""
    inputs = [path for path in (file, record_path, config) if path is not None]
    require_new_file(output, inputs, force=force)
    record = read_record(record_path) if record_path else None
    # The piece must be checked with effort and profile of the record: with others the finding may not be there.
    effort = record.effort if record and record.effort in get_args(Effort) else None
    profile = record.profile if record and record.profile in PROFILES else None
    asked = {**overrides, "effort": overrides["effort"] or effort, "profile": profile}
    options = check_options(settings_from(config, asked))
    require_one_sequence(file, options.dialect)
    opening = opening_test(file, options.dialect, options.allow_external)
    if record and record_path:
        file_record = _part_about(file, record, record_path)
    else:
        with progress_bar(file.name) as bar:
            file_record = run_isolated(Task(CHECK_WHOLE, (file, None, options)), file, opening, bar).record
    wanted = _wanted(finding, file_record)
    with progress_bar(file.name) as bar:
        try:
            with staging_path(output) as written:
                task = Task(_cut, (file, written, wanted, options, longest_s))
                extracted = run_isolated(task, file, opening, bar)
                written.replace(output)
        except UnreadableFileError as problem:
            raise MisuseError(
                f"Expected a file to cut a piece out of, got: {problem}; send the file as it is"
            ) from None
    # What the piece holds, and whether the finding is found in it.
    sizes = [local_version(path).size / 1e6 for path in (output, file)]
    lines = [f"{output}: {sizes[0]:.3g} MB of the {sizes[1]:.3g} MB of {file}"]
    lines += [
        f"  {stream:<14} rows {rows.start} to {rows.stop} of {rows.of}" for stream, rows in extracted.kept.items()
    ]
    lines += [
        f"  {path} was left out: no stream is known that it belongs to, or it cannot be read"
        for path in extracted.left_out
    ]
    if extracted.finding:
        whole = " All rows are in it: nothing shorter shows the finding." if extracted.is_whole else ""
        lines.append(f"{finding} ({wanted.finding.code}) is found in it: {extracted.finding.message}{whole}")
    else:
        longer = "it may need more of the file, or all of it; see --longest"
        lines.append(f"{finding} ({wanted.finding.code}) is not found in it: {longer}")
    for line in lines:
        click.echo(unobeyed(line))
    return CLEAN if extracted.finding else INCOMPLETE


def _cut(
    file: Path, output: Path, wanted: CheckFinding, options: CheckOptions, longest_s: float, worker: Worker
) -> Extraction:
    def report(piece: str, done: int, of: int) -> None:
        worker.progress(f"checking {piece}", done, of)

    return extract_piece(file, output, wanted, options, longest_s, report)


def _part_about(file: Path, record: Record, record_path: Path) -> FileRecord:
    """Return the part of a record about a file, identified by content; raises ``MisuseError`` where it has none."""
    # By content, not by path: the file may have been moved, and another may now lie at its path.
    digest = file_digest(file)
    for file_record in record.files:
        if (file_record.sha256, file_record.digest_kind) == (digest.sha256, digest.kind):
            return file_record
    paths = ", ".join(file_record.path for file_record in record.files)
    raise MisuseError(f"Expected a record of {file} as it is, got {record_path}, of other content ({paths})")


def _wanted(finding: str, file_record: FileRecord) -> CheckFinding:
    """Return the finding with this identifier; raises ``MisuseError`` where there is none."""
    findings = {each.id: CheckFinding(result.check, each) for result in file_record.results for each in result.findings}
    if finding not in findings:
        available = ", ".join(findings) if findings else "no findings"
        raise MisuseError(f"Expected a finding of {file_record.path} ({available}), got {finding!r}")
    wanted = findings[finding]
    # A finding of a release compares several files; no piece of one file can show it.
    if wanted.check.startswith("release."):
        raise MisuseError(f"Expected a finding about a sequence, got {finding}, which is about the release")
    return wanted
