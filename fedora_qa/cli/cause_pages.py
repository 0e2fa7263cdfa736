"""The pages of the documentation on the causes, made from what the code states of each.

``python -m fedora_qa.cli.check_pages`` writes them.
"""

from collections.abc import Mapping
from typing import Any

from fedora_qa.catalogue import CHECKS
from fedora_qa.causes import CAUSES, Cause
from fedora_qa.cli.markdown import check_link, code_list, markdown_of
from fedora_qa.diagnosis.direct import is_direct
from fedora_qa.faults.table import FAULTS, WithoutInverse
from fedora_qa.repairs.mechanical import MECHANICAL

_INDEX = """\
# Causes

A cause is the name of what is wrong with a stream, with its size and a remedy. `fedora-qa check` lists the probable
causes below the findings. [How a cause is tested](../trials.md) states when a cause is `confirmed`. `make docs` writes
these pages.

A size is positive where timestamps are too late, or values too large. `fedora-generate fault FILE CAUSE -o OUT` plants
a cause in a copy of a file ([corpora](../corpus.md#local-faults)). The [tables of detection power](../power-tables.md)
state how often each is found and named, by size.

| cause | streams | what is wrong |
| --- | --- | --- |
"""


def cause_pages() -> Mapping[str, str]:
    """Return the text of every page, Markdown, by its file's name."""
    index = _INDEX
    pages = {}
    for cause in CAUSES.values():
        index += f"| [`{cause.identifier}`]({cause.identifier}.md) | {code_list(cause.streams)} | {cause.meaning} |\n"
        pages[f"{cause.identifier}.md"] = _page(cause)
    return {"README.md": index, **pages}


def _page(cause: Cause) -> str:
    unit = {"": "none: the fault exists or not", "1": "a number without a unit"}.get(cause.unit, f"in {cause.unit}")
    checks = [check.name for check in CHECKS if is_direct(cause.identifier, f"{check.name}.rule")]
    if checks:
        detection = f"Measured directly by {', '.join(check_link(check) for check in checks)}."
    elif any(_is_undoable(cause.identifier, stream) for stream in cause.streams):
        detection = "Proposed where it explains failed checks, and tested by a trial."
    else:
        detection = "Proposed where it explains failed checks. No trial can test it."
    rows = "".join(
        f"| {code_list(streams)} | {in_memory} | {in_a_copy} |\n" for (in_memory, in_a_copy), streams in _undoing(cause)
    )
    return (
        f"# {cause.identifier}\n\n"
        f"**{cause.meaning[0].upper()}{cause.meaning[1:]}.**\n\n"
        f"- Streams: {code_list(cause.streams)}\n"
        f"- Size: {unit}\n"
        f"- Remedy: {cause.remedy}\n\n"
        f"## How it is known\n\n{detection}\n\n"
        "## Can it be undone?\n\n"
        "A [trial](../trials.md) undoes the fault in memory and measures again.\n"
        "[`fedora-qa repair`](../repair.md) undoes it in a copy of the file.\n\n"
        "| stream | in memory | by `repair` |\n| --- | --- | --- |\n" + rows
    )


def _is_undoable(cause: str, stream: str) -> bool:
    return not isinstance(FAULTS[cause, stream], WithoutInverse)


def _undoing(cause: Cause) -> list[tuple[tuple[str, str], list[str]]]:
    """Return how a cause is undone in memory and in a copy, in words, with the streams to which this applies."""
    streams_of: dict[tuple[str, str], list[str]] = {}
    for stream in cause.streams:
        entry = FAULTS[cause.identifier, stream]
        if isinstance(entry, WithoutInverse):
            streams_of.setdefault((f"no: {entry.reason}", "no"), []).append(stream)
        else:
            for fault in entry:
                streams_of.setdefault((_first_line(fault), _repair_of(fault)), []).append(stream)
    return list(streams_of.items())


def _first_line(fault: type[Any]) -> str:
    """Return the effect of a fault, by the first line of its docstring."""
    return f"yes: {markdown_of((fault.__doc__ or '').splitlines()[0])}"


def _repair_of(fault: type[Any]) -> str:
    reason = MECHANICAL[fault]
    if not isinstance(reason, str):
        return "[in part](../repair.md#what-is-mechanical)"
    return f"no: {reason}" if reason else "yes"
