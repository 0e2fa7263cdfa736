"""Text, lines, tables and whole pages as HTML for a notebook; all text from a file is escaped."""

import html
from collections.abc import Iterable, Sequence

from fedora_qa.record.wording import printable


def html_text(text: str) -> str:
    """Return text as HTML, one harmless line."""
    return html.escape(printable(text))


def html_lines(lines: Iterable[str]) -> str:
    """Return lines as they stand, blanks included."""
    content = "\n".join(map(html_text, lines))
    return f"<pre>{content}</pre>"


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]], title: str = "") -> str:
    """Return a table; ``title`` stands above it."""
    caption = f"<caption>{html_text(title)}</caption>" if title else ""
    return f"<table>{caption}{_row('th', head)}{''.join(_row('td', row) for row in rows)}</table>"


def isolated_frame(page: str) -> str:
    """Return an HTML document in a frame whose scripts cannot reach the notebook."""
    return (
        # Sandboxed without ``allow-same-origin``: scripts of the report cannot reach the page of the notebook.
        f'<iframe srcdoc="{html.escape(page)}" sandbox="allow-scripts" title="fedora-qa report" '
        'style="width: 100%; height: 800px; border: 1px solid #8888"></iframe>'
    )


def _row(tag: str, cells: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{html_text(cell)}</{tag}>' for cell in cells)}</tr>"
