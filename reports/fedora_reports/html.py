"""The report: one self-contained HTML file that needs no network, drawn from a record and its evidence."""

import base64
import hashlib
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from numpy.typing import NDArray

from fedora_qa.record.json_io import record_from_json, record_to_json
from fedora_qa.record.latex import LATEX_NEEDS, latex_table
from fedora_qa.record.tables import table_to_csv
from fedora_qa.record.types import Record
from fedora_qa.record.wording import capitalised, printable
from fedora_reports.detection_power import NOTHING_KNOWN, PassDetectionPower
from fedora_reports.page import NO_PRICES, page_of
from fedora_reports.statistics import Table

_SCRIPTS: Final = ("listing.js", "frames.js", "space.js", "copy.js", "start.js")


def render_html(
    record: Record,
    arrays: Mapping[str, NDArray[Any]],
    detection_power: PassDetectionPower = NOTHING_KNOWN,
    fault_prices: Mapping[str, str] = NO_PRICES,
) -> str:
    """Return the report of a record as one HTML document.

    Parameters
    ----------
    record
        The results. Numbers that are not finite are shown as "not a number".
    arrays
        The evidence by name, as ``fedora_qa.record.evidence`` describes; with several files each name is preceded by
        the file's index in the record (``0/name``). Missing and malformed arrays are left out, and the report states
        that.
    detection_power
        The faults that each check detects, where that was measured.
    fault_prices
        What the faults that a check measures cost a learner, by check, where that was measured.

    Returns
    -------
    str
        A document that loads no other file and runs one script of its own: its policy allows the script by its digest,
        and forbids all else. The document can be read without the script. Everything from a file is shown as text.
    """
    same = record_from_json(record_to_json(record))
    return rendered("report.html.j2", page_of(same, arrays, detection_power, fault_prices))


def rendered(template: str, page: object) -> str:
    """Return a page with the script of the reports, which its policy allows by its digest."""
    script = report_script()
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    return (
        environment().get_template(template).render(page=page, script=Markup(script), script_digest=f"sha256-{digest}")
    )


@cache
def report_script() -> str:
    """Return the script of the report, for every part of the page that reacts to a reader."""
    folder = files("fedora_reports") / "script"
    parts = [(folder / name).read_text(encoding="utf-8") for name in _SCRIPTS]
    return '"use strict";\n' + "".join(parts)


@cache
def environment() -> Environment:
    """Return the templates with their filters; compiled once a process."""
    environment = Environment(
        loader=PackageLoader("fedora_reports"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_harmless,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["percent"] = _percent
    environment.filters["wrapping"] = _wrapping
    environment.filters["sentence"] = _sentence
    environment.filters["csv"] = _csv
    environment.filters["latex"] = _latex
    return environment


def _harmless(value: object) -> object:
    """Replace control, invisible and direction-turning characters of a file's text before it is escaped."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return value if value.isascii() and value.isprintable() else printable(value)  # pictures are long, and of ASCII


def _percent(share: float) -> str:
    """Return a share as SVG takes a length relative to the drawing."""
    return f"{100 * share:.2f}%"


def _wrapping(name: str) -> Markup:
    """Return an identifier, escaped, that may be broken after its dots, slashes and underscores."""
    text = str(escape(printable(name)))  # a plain string: joined as Markup, what is added would be escaped
    return Markup(re.sub(r"([._/])", r"\1<wbr>", text))


def _csv(table: Table) -> Markup:
    """Return a table as CSV, escaped, with its lines."""
    return Markup(escape(table_to_csv(table.head, table.rows)))


def _latex(table: Table) -> Markup:
    """Return a table as LaTeX, escaped, with its lines."""
    return Markup(escape(f"{LATEX_NEEDS}\n{latex_table(table.title, table.head, table.rows, table.note)}\n"))


def _sentence(text: str) -> str:
    """Return a clause as a sentence: with a capital and a full stop."""
    stop = "" if text.endswith((".", "!", "?")) else "."
    return f"{capitalised(text)}{stop}"
