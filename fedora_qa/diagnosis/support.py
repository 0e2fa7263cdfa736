"""The support that a hypothesis has from a rule alone: the hand-set numbers of diagnosis, each with its reason."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from types import MappingProxyType
from typing import Final


@dataclass(frozen=True, slots=True)
class Support:
    """Support by a rule, with the reason for its value.

    Attributes
    ----------
    value
        0 to 1.
    reason
        Why the value is not another.
    """

    value: float
    reason: str


SUPPORT: Final[Mapping[str, Support]] = MappingProxyType({
    f"{subject}.{name}": Support(float(value), reason)
    for subject, section in tomllib.loads(
        resources.files("fedora_qa.diagnosis").joinpath("support.toml").read_text(encoding="utf-8")
    ).items()
    for name, (value, reason) in section.items()
})  # fmt: skip
"""By ``<subject>.<name>``: the sections and keys of support.toml."""


def support(name: str) -> float:
    """Return the number of a row of the table.

    Raises
    ------
    KeyError
        The table has no such row.
    """
    return SUPPORT[name].value
