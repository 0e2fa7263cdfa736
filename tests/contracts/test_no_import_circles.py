"""No file imports another that imports it in turn: every folder has a first file to read."""

import ast
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[2]
PACKAGES: Final = {
    "fedora_qa": ROOT / "fedora_qa",
    "fedora_generator": ROOT / "generator" / "fedora_generator",
    "fedora_reports": ROOT / "reports" / "fedora_reports",
}


def imported_by(tree: ast.Module) -> Iterator[str]:
    """Yield the dotted names that a module imports, within functions too, but not for type checkers alone."""
    nodes: list[ast.AST] = [tree]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            nodes += node.orelse
            continue
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        nodes += ast.iter_child_nodes(node)


def import_graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """Return which of the modules each of them imports: a name from a package counts as the module of that name."""
    graph = {}
    for name, source in sources.items():
        imported = set(imported_by(ast.parse(source)))
        # ``from package import module`` runs the package too; that the package lists its modules is no circle.
        packages = {target.rpartition(".")[0] for target in imported if target in sources}
        graph[name] = {target for target in imported - packages if target in sources and target != name}
    return graph


def modules(folder: Path, package: str) -> dict[str, str]:
    sources = {}
    for path in folder.rglob("*.py"):
        name = ".".join((package, *path.relative_to(folder).with_suffix("").parts)).removesuffix(".__init__")
        sources[name] = path.read_text(encoding="utf-8")
    return sources


@pytest.mark.parametrize("package", PACKAGES)
def test_no_circles(package: str) -> None:
    """The files of a package can be put into an order in which each imports only earlier ones."""
    tuple(TopologicalSorter(import_graph(modules(PACKAGES[package], package))).static_order())


def test_a_circle_is_found() -> None:
    """Also where one of its imports stands within a function."""
    sources = {"p.a": "from p.b import f", "p.b": "def g():\n    from p import c", "p.c": "import p.a"}
    with pytest.raises(CycleError):
        tuple(TopologicalSorter(import_graph(sources)).static_order())


def test_what_only_type_checkers_import_is_no_circle() -> None:
    """It is never run."""
    sources = {"p.a": "from p.b import f", "p.b": "if TYPE_CHECKING:\n    from p.a import T"}
    assert tuple(TopologicalSorter(import_graph(sources)).static_order()) == ("p.b", "p.a")
