"""The page of the documentation on the datasets and attributes of the canonical layout, made from its description.

``python -m fedora_qa.cli.check_pages`` writes it.
"""

from fedora_qa.cli.markdown import code_list
from fedora_qa.layout.canonical import ATTRIBUTES, DATASETS, AttributeSpec, DatasetSpec

_INTRODUCTION = """\
# Datasets and attributes

This page lists the canonical layout, version 1.0. [The file format](format.md) explains it, and `make docs` writes
this page. A letter in a shape stands for a size that all datasets of a file share: `N` colour frames, `D` depth
frames, `E` events, `M` IMU samples, `P` poses. Flow of another rate than 10, 25 and 50 Hz has the same form.

## Datasets

| dataset | type | shape | unit | meaning |
| --- | --- | --- | --- | --- |
"""

_ATTRIBUTES = """
## Attributes

Each dataset also carries its unit as the attribute `units`.
"""


def layout_page() -> str:
    """Return the text of the page, Markdown."""
    page = _INTRODUCTION + "".join(_dataset_row(spec) for spec in DATASETS.values()) + _ATTRIBUTES
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
