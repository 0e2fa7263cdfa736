"""Which unit tests could notice a change of a module: those that import it, directly or through other modules."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

PACKAGES: Final = ("estimators", "judgement")
_IMPORT: Final = re.compile(r"fedora_qa\.((?:estimators|judgement)(?:\.\w+)+)")


def modules(root: Path) -> list[Path]:
    """Return the modules that are mutated: all of both packages but those that hold compiled kernels only.

    Kernels are compiled anew for each change, which takes longer than their tests; their callers are mutated.
    """
    paths = (path for package in PACKAGES for path in sorted((root / "fedora_qa" / package).rglob("*.py")))
    return [path for path in paths if not path.stem.endswith(("__init__", "_kernels"))]


def unit_tests_of(module: Path, root: Path) -> list[Path]:
    """Return the test files to run for a module, those that name it first."""
    tests = {
        path: _imports(path) for package in PACKAGES for path in sorted((root / "tests" / package).rglob("test_*.py"))
    }
    inner = {_name(path, root): _imports(path) for path in modules(root)}
    distances = _distances(_name(module, root), inner)
    near = {
        path: min((distances[name] for name in names & distances.keys()), default=None) for path, names in tests.items()
    }
    reached = [(distance, path) for path, distance in near.items() if distance is not None]
    return [path for _, path in sorted(reached)]


def _distances(name: str, inner: Mapping[str, Iterable[str]]) -> dict[str, int]:
    """Return by how many imports each module lies above the named one."""
    distances = {name: 0}
    grown = True
    while grown:
        users = {user for user, used in inner.items() if user not in distances and distances.keys() & set(used)}
        distances |= dict.fromkeys(users, max(distances.values()) + 1)
        grown = bool(users)
    return distances


def _imports(path: Path) -> set[str]:
    return set(_IMPORT.findall(path.read_text(encoding="utf-8")))


def _name(path: Path, root: Path) -> str:
    return ".".join(path.relative_to(root / "fedora_qa").with_suffix("").parts)
