"""The report: one self-contained HTML file that needs no network, drawn from a record and its evidence."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from numpy.typing import NDArray

from fedora_qa.record.json_io import record_from_json, record_to_json
from fedora_qa.record.types import Record
from fedora_qa.record.wording import printable
from fedora_reports.page import page_of


def render_html(record: Record, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the report of a record as one HTML document.

    Parameters
    ----------
    record
        What was found. It is shown as it is written: what is not a finite number is "not a number".
    arrays
        The evidence by name, as ``fedora_qa.record.evidence`` describes; with several files each name is preceded by
        the file's place in the record, counted from 0 (``0/name``). What is missing or malformed is left out, and
        the report says so.

    Returns
    -------
    str
        A document without scripts that asks for nothing beyond itself; its policy forbids both. Whatever comes from
        a file is shown as text.
    """
    page = page_of(record_from_json(record_to_json(record)), arrays)
    return environment().get_template("report.html.j2").render(page=page)


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
    return environment


def _harmless(value: object) -> object:
    """Make text from a file printable before it is escaped: no control, invisible or direction-turning characters."""
    return printable(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _percent(share: float) -> str:
    """Return a share as SVG takes a length relative to the drawing."""
    return f"{100 * share:.2f}%"


def _wrapping(name: str) -> Markup:
    """Return an identifier, escaped, that may be broken after its dots, slashes and underscores."""
    text = str(escape(printable(name)))  # a plain string: joined as Markup, what is added would be escaped
    return Markup(re.sub(r"([._/])", r"\1<wbr>", text))


def _sentence(text: str) -> str:
    """Return a clause as a sentence: with a capital and a full stop."""
    stop = "" if text.endswith((".", "!", "?")) else "."
    return f"{text[:1].upper()}{text[1:]}{stop}"
