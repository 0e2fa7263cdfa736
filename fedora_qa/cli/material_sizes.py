"""The sizes from which a check's deviations are material, in words, for ``fedora-qa explain`` and its pages."""

from fnmatch import fnmatchcase
from typing import Final

from fedora_qa.judgement.materiality import MATERIALITY, MaterialityRow
from fedora_qa.record.wording import with_unit

TITLE: Final = "Material sizes"


def material_sizes_text(check: str) -> str:
    """Return the material sizes of the measurements of a check, a kind a line."""
    lines = []
    for row in MATERIALITY:
        rules = [code.removeprefix(f"{check}.") for code in row.codes if code.startswith(f"{check}.")]
        if any(fnmatchcase(f"{check}.any", code) for code in row.codes):
            rules = ["every rule"]
        if rules:
            lines.append(f"{', '.join(rules)}: {_sizes(row)} ({row.reason})")
    return "\n".join(lines)


def _sizes(row: MaterialityRow) -> str:
    if row.exact:
        return "every deviation"
    if row.drift:
        return f"the rate that adds up to {row.release:g} ms over the file, for training {row.training:g} ms"
    if row.relative:
        return f"{row.release:.3g} of the expected value, for training {row.training:.3g}"
    return f"from {with_unit(row.release, row.unit)} on, for training {with_unit(row.training, row.unit)}"
