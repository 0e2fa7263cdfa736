"""Files of the repository that the code writes: pages of checks, causes and layout; explanations; schemas.

``python -m fedora_qa.cli.generated_files docs/checks`` writes one page a subject and an index from the docstrings of
the checks, and the explanations that the package holds. Beside the folder it writes the pages of the causes, and that
of the datasets and attributes; and into the package the published schemas.
"""

import sys
from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter

import fedora_qa
from fedora_qa.catalogue import all_checks
from fedora_qa.causes import CAUSES, Cause
from fedora_qa.check_names import subject_of
from fedora_qa.checks.explanation import PUBLISHED, Explanation, explanation, explanations_text
from fedora_qa.cli.markdown import check_link, code_list, heading_anchor, markdown_of
from fedora_qa.cli.schema import SCHEMAS
from fedora_qa.comparison.types import COMPARISON
from fedora_qa.config import CONFIG_READER
from fedora_qa.diagnosis.direct import is_direct
from fedora_qa.faults.table import FAULTS, WithoutInverse
from fedora_qa.gating.certificate import CERTIFICATE
from fedora_qa.gating.policy import POLICY_READER
from fedora_qa.judgement.materiality import MATERIALITY, MaterialityRow
from fedora_qa.layout.canonical import ATTRIBUTES, DATASETS, AttributeSpec, DatasetSpec
from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import DocumentKind, schema_of, schema_text
from fedora_qa.record.json_io import RECORD
from fedora_qa.record.power_study import POWER
from fedora_qa.record.wording import capitalised, with_unit
from fedora_qa.repairs.mechanical import MECHANICAL
from fedora_qa.scoring.types import SCORE

_MATERIAL_SIZES: Final = "Material sizes"

_CAUSES_INDEX: Final = """\
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

_DATASETS_INTRODUCTION: Final = """\
# Datasets and attributes

This page lists the canonical layout, version 1.0. [The file format](format.md) explains it, and `make docs` writes
this page. A letter in a shape stands for a size that all datasets of a file share: `N` colour frames, `D` depth
frames, `E` events, `M` IMU samples, `P` poses. Flow of another rate than 10, 25 and 50 Hz has the same form.

## Datasets

| dataset | type | shape | unit | meaning |
| --- | --- | --- | --- | --- |
"""

_ATTRIBUTES_INTRODUCTION: Final = """
## Attributes

Each dataset also carries its unit as the attribute `units`.
"""

_DOCUMENTS: tuple[DocumentKind[Any], ...] = (RECORD, COMPARISON, SCORE, POWER, CERTIFICATE)
_READERS: Mapping[str, TypeAdapter[Any]] = {"config": CONFIG_READER, "policy": POLICY_READER}


def explanations() -> tuple[Explanation, ...]:
    """Return the explanation of every check, with its material sizes as the last section."""
    explained = [explanation(check) for check in all_checks()]
    return tuple(
        replace(each, sections={**each.sections, _MATERIAL_SIZES: _material_sizes_text(each.check)})
        for each in explained
    )


def check_pages() -> Mapping[str, str]:
    """Return the pages of the checks, Markdown, by the names of their files."""
    explanations_of: dict[str, list[Explanation]] = {}
    for each in explanations():
        explanations_of.setdefault(subject_of(each.check), []).append(each)
    index = (
        "# Checks\n\nEach page has the text of `fedora-qa explain` for the checks of a subject. "
        "`make docs` writes these pages.\n"
    )
    pages: dict[str, str] = {}
    for subject, explained in explanations_of.items():
        index += f"\n## [{subject}]({subject}.md)\n\n"
        page = f"# {subject}\n"
        for each in explained:
            index += f"- [`{each.check}`]({subject}.md#{heading_anchor(each.check)}): {each.question}\n"
            page += f"\n## {each.check}\n\n**{each.question}**\n\nNeeds: {', '.join(each.needs) or 'no stream'}.\n"
            page += f"\n{markdown_of(each.measured)}\n"
            sizes = "\n".join(f"- {line}" for line in each.sections[_MATERIAL_SIZES].splitlines())
            for title, text in {**each.sections, _MATERIAL_SIZES: sizes}.items():
                page += f"\n### {title}\n\n{markdown_of(text)}\n"
        pages[f"{subject}.md"] = page
    return {"README.md": index, **pages}


def _material_sizes_text(check: str) -> str:
    """Return the material sizes of the measurements of a check, a kind a line."""
    lines = []
    for row in MATERIALITY:
        rules = [code.removeprefix(f"{check}.") for code in row.codes if code.startswith(f"{check}.")]
        if any(fnmatchcase(f"{check}.any", code) for code in row.codes):
            rules = ["every rule"]
        if rules:
            lines.append(f"{', '.join(rules)}: {_size_words(row)} ({row.reason})")
    return "\n".join(lines)


def _size_words(row: MaterialityRow) -> str:
    if row.exact:
        return "every deviation"
    if row.drift:
        return f"the rate that adds up to {row.release:g} ms over the file, for training {row.training:g} ms"
    if row.relative:
        return f"{row.release:.3g} of the expected value, for training {row.training:.3g}"
    sizes = f"from {with_unit(row.release, row.unit)} on, for training {with_unit(row.training, row.unit)}"
    if row.release_px is None or row.training_px is None:
        return sizes
    return f"{sizes}, and where it changes the flow by {row.release_px:g} px, for training {row.training_px:g} px"


def cause_pages() -> Mapping[str, str]:
    """Return the pages of the causes, Markdown, by the names of their files."""
    index = _CAUSES_INDEX
    pages = {}
    for cause in CAUSES.values():
        index += f"| [`{cause.identifier}`]({cause.identifier}.md) | {code_list(cause.streams)} | {cause.meaning} |\n"
        pages[f"{cause.identifier}.md"] = _cause_page(cause)
    return {"README.md": index, **pages}


def _cause_page(cause: Cause) -> str:
    unit = {"": "none: the fault exists or not", "1": "a number without a unit"}.get(cause.unit, f"in {cause.unit}")
    checks = [check.name for check in all_checks() if is_direct(cause.identifier, f"{check.name}.rule")]
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
        f"**{capitalised(cause.meaning)}.**\n\n"
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


def layout_page() -> str:
    """Return the page on the datasets and attributes of the canonical layout, Markdown."""
    page = _DATASETS_INTRODUCTION + "".join(_dataset_row(spec) for spec in DATASETS.values()) + _ATTRIBUTES_INTRODUCTION
    for owner in dict.fromkeys(owner for owner, _ in ATTRIBUTES):
        title = f"`{owner}`" if owner else "The file itself"
        page += f"\n### {title}\n\n| attribute | type | unit | | meaning |\n| --- | --- | --- | --- | --- |\n"
        page += "".join(_attribute_row(spec) for spec in ATTRIBUTES.values() if spec.owner == owner)
    return page


def _dataset_row(spec: DatasetSpec) -> str:
    meaning = f"{spec.meaning}; may be left out" if spec.optional else spec.meaning
    return f"| `{spec.key}` | {spec.dtype} | {' x '.join(map(str, spec.shape))} | {spec.units} | {meaning} |\n"


def _attribute_row(spec: AttributeSpec) -> str:
    need = "required" if spec.required else "may be left out"
    values = f": {code_list(spec.choices)}" if spec.choices else ""
    return f"| `{spec.name}` | {spec.kind} | {spec.units} | {need} | {spec.meaning}{values} |\n"


def schemas() -> dict[str, dict[str, Any]]:
    """Return every published schema by its name."""
    # Documents as they are written: every field is there. Configurations as they are read: fields may be absent.
    written = {kind.name: kind.schema() for kind in _DOCUMENTS}
    read = {name: schema_of(name, reader, "validation") for name, reader in _READERS.items()}
    return written | read


def schema_path(name: str) -> Path:
    """Return where a schema lies in the package."""
    package, file, _ = SCHEMAS[name]
    root = Path(fedora_qa.__file__).parent
    return root.joinpath(*package.split(".")[1:], file)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    causes = folder.parent / "causes"
    for target in (folder, causes):
        target.mkdir(parents=True, exist_ok=True)
    for name, text in check_pages().items():
        write_text(folder / name, text)
    for name, text in cause_pages().items():
        write_text(causes / name, text)
    write_text(folder.parent / "datasets.md", layout_page())
    write_text(PUBLISHED, explanations_text(explanations()))
    for name, schema in schemas().items():
        write_text(schema_path(name), schema_text(schema))
