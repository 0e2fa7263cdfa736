"""Check samples of real data, and print as markdown what was found: ``make study-real-data PATHS='...'``.

A path may be followed by an option of its import: ``evt2.raw@640x480``, ``flight.bag@pose=/odom``.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from fedora_qa.api.check import check
from fedora_qa.errors import MisuseError
from fedora_qa.record.types import FileRecord
from tests.benchmarks.real_data.samples import Sample, sample_of


@click.command()
@click.argument("paths", nargs=-1, required=True)
def main(paths: tuple[str, ...]) -> None:
    """Check each sample by itself."""
    for text in paths:
        name, _, option = text.partition("@")
        with TemporaryDirectory() as work:
            click.echo("".join(section(Path(name), option, Path(work))))


def section(path: Path, option: str, work: Path) -> Iterator[str]:
    """Yield what is found in one sample; a sample that cannot be read has the message as its only finding."""
    yield f"## {path.parent.name}/{path.name}\n\n"
    try:
        sample = sample_of(path, option, work)
    except MisuseError as error:
        yield f"Not read: {error}\n"
        return
    yield from outcome(sample, record_of(sample))


def record_of(sample: Sample) -> FileRecord:
    """Return the record of a sample, checked with full effort."""
    return check(sample.sequence, dialect=sample.dialect, metadata=sample.metadata, evidence=False).files[0]


def outcome(sample: Sample, file: FileRecord) -> Iterator[str]:
    """Yield the verdict, the number of checks by outcome, the properties that were measured, and all findings."""
    counts = Counter(result.outcome for result in file.results)
    numbers = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.most_common())
    yield f"Given by {sample.given}. Verdict: **{file.verdict}** ({numbers}).\n\n"
    passed = [result.check for result in file.results if result.outcome == "passed"]
    yield f"Passed: {', '.join(passed) or 'none'}.\n\n"
    for name, value in file.inferred.items():
        if not name.startswith(("files.", "declared.")):
            yield (
                f"- measured: {name} = {value:.6g}\n" if isinstance(value, float) else f"- measured: {name} = {value}\n"
            )
    for result in file.results:
        for finding in result.findings:
            yield f"- {result.outcome}, {finding.severity}: `{finding.code}`: {finding.message}\n"
    for diagnosis in file.diagnoses:
        yield f"- cause: `{diagnosis.stream}:{diagnosis.cause}` ({diagnosis.status})\n"


if __name__ == "__main__":
    main()
