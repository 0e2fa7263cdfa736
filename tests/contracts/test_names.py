"""Names use the words of GLOSSARY.md: no pronouns, participles or metaphors."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("fedora_qa", "generator/fedora_generator", "reports/fedora_reports")

NO_NAMES = {
    *("one", "found", "told", "seen", "known", "shown", "mended", "undone", "telling", "untold"),
    *("surer", "lateness", "desk", "fuse", "stamp", "stamps"),
}
NO_CLASSES = {
    *("Told", "Shown", "Mended", "Held", "Seen", "Found", "Sealed", "Surveyed", "Known"),
    *("Desk", "Lateness", "Answer", "Clues"),
}

PUBLIC_FIELDS = {
    "fedora_qa/record/types.py": {"seen"},
    "fedora_qa/record/power_study.py": {"found"},
    "fedora_qa/comparison/types.py": {"told"},
    "fedora_qa/power/detection_power.py": {"found"},
}
"""Fields of published documents, which keep their names."""


def banned_names(source: str) -> list[str]:
    """Return the banned names that a module gives to variables, arguments and classes, in order."""
    banned = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in NO_NAMES:
            banned.append(node.id)
        elif isinstance(node, ast.arg) and node.arg in NO_NAMES:
            banned.append(node.arg)
        elif isinstance(node, ast.ClassDef) and node.name.lstrip("_") in NO_CLASSES:
            banned.append(node.name)
    return banned


def modules() -> list[str]:
    paths = [path.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    return sorted(str(path) for path in paths)


@pytest.mark.parametrize("path", modules())
def test_names_say_what_they_are(path: str) -> None:
    """No variable, argument or class of the module has a banned name."""
    banned = banned_names((ROOT / path).read_text(encoding="utf-8"))
    assert set(banned) <= PUBLIC_FIELDS.get(path, set())


@pytest.mark.parametrize(
    "source", ["one = 1", "for found in (): pass", "def f(told): pass", "f = lambda seen: 0", "class _Shown: pass"]
)
def test_a_banned_name_is_found(source: str) -> None:
    """The test above can fail."""
    assert banned_names(source)


def test_classes_have_unique_names() -> None:
    """No two classes of a package have one name."""
    for package in PACKAGES:
        places: dict[str, list[str]] = {}
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
        assert {name: found for name, found in places.items() if len(found) > 1} == {}
