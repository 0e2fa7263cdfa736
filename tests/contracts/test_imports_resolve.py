"""Every import of our own modules resolves, also in studies that no test runs."""

import ast
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[2]
OURS: Final = ("fedora_qa", "fedora_generator", "fedora_reports", "tests")
STUDIES: Final = sorted(path for name in ("benchmarks", "fuzz") for path in (ROOT / "tests" / name).rglob("*.py"))


def names_of(module: str) -> set[str]:
    """Return the names that a module defines, by reading it: some need what only their study installs."""
    spec = find_spec(module)
    assert spec, f"there is no module {module}"
    if not spec.origin:  # a folder without ``__init__.py``
        return set()
    names: set[str] = set()
    for node in ast.walk(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.alias):
            names.add(node.asname or node.name)
    return names


@pytest.mark.parametrize("study", STUDIES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_imports_resolve(study: Path) -> None:
    """The names that a study imports are there."""
    for node in ast.walk(ast.parse(study.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in OURS:
            absent = {alias.name for alias in node.names} - names_of(node.module)
            assert not {name for name in absent if find_spec(f"{node.module}.{name}") is None}
