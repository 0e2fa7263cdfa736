"""HTML of a record for notebooks. All text from a file is escaped."""

from collections.abc import Iterable, Iterator, Mapping
from html import escape
from typing import Any

from numpy.typing import NDArray

from fedora_qa.cli.html import render_html_or_none
from fedora_qa.record.types import FileRecord, Record
from fedora_qa.record.wording import cause_sentence, findings_of, headline, place, printable


def report_frame(record: Record, arrays: Mapping[str, NDArray[Any]]) -> str | None:
    """Return the report in a frame that is isolated from the notebook; None where its package is not installed."""
    page = render_html_or_none(record, arrays)
    if page is None:
        return None
    return (
        # Sandboxed without ``allow-same-origin``: scripts of the report cannot reach the page of the notebook.
        f'<iframe srcdoc="{escape(page)}" sandbox="allow-scripts" title="fedora-qa report" '
        'style="width: 100%; height: 800px; border: 1px solid #8888"></iframe>'
    )


def light_page(record: Record) -> str:
    """Return the verdict of each file, its probable causes, and its findings as a table."""
    return "".join(part for file in record.files for part in _file(file))


def _file(file: FileRecord) -> Iterator[str]:
    yield f"<h4>{_text(file.path)}</h4><p><b>{_text(headline(file))}</b></p>"
    if file.diagnoses:
        causes = (f"<li>{_text(f'{cause_sentence(cause)}. {cause.remedy}')}</li>" for cause in file.diagnoses)
        yield f"<ul>{''.join(causes)}</ul>"
    finding_rows = [(f.id, f.severity, f.code, f.message, place(f.where)) for _, f in findings_of(file)]
    if finding_rows:
        rows = (_row("td", cells) for cells in finding_rows)
        yield f"<table>{_row('th', ('id', 'severity', 'rule', 'finding', 'where'))}{''.join(rows)}</table>"


def _row(tag: str, cells: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{_text(cell)}</{tag}>' for cell in cells)}</tr>"


def _text(text: str) -> str:
    return escape(printable(text))
