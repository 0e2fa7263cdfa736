"""Small changes of the code that tests should notice, made by cosmic-ray's operators.

Left out is what would flatter the tests: bitwise operators, shifts and remainders in place of arithmetic mostly end in
a TypeError. And what no test could see: annotations (``X | None`` reads like a bitwise or), decorators (``slots``), and
the operator that does nothing.
"""

import ast
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

_LEFT_OUT: Final = re.compile(r"NoOp|RemoveDecorator|Bit|Shift|Mod|FloorDiv|Invert")


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: the module, the operator, and at which of the places where it applies; ``line`` counts from 1."""

    module: Path
    operator: str
    occurrence: int
    line: int

    def code(self, source: str) -> str:
        """Return the module's source with the change."""
        mutated = mutate_code(source, _operator(self.operator), self.occurrence)
        if mutated is None:
            raise ValueError(
                f"Expected {self.operator} to apply {self.occurrence + 1} times in {self.module}, got fewer"
            )
        return str(mutated)


def mutants_of(module: Path) -> Iterator[Mutant]:
    """Yield every mutant of a module outside of its compiled kernels."""
    source = module.read_text(encoding="utf-8")
    tree, kernels = get_ast(source), kernel_lines(source)
    for name in sorted(operator_names()):
        if _LEFT_OUT.search(name) or get_operator(name).arguments():
            continue
        operator = _operator(name)
        places = (place for node in ast_nodes(tree) for place in operator.mutation_positions(node))
        for occurrence, ((line, _), _) in enumerate(places):
            if line not in kernels:
                yield Mutant(module, name, occurrence, line)


def kernel_lines(source: str) -> frozenset[int]:
    """Return the lines of functions that Numba compiles: anew for each change, which takes longer than their tests."""
    return frozenset(
        line
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef) and any("njit" in ast.unparse(mark) for mark in node.decorator_list)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    )


def drawn(mutants: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """Return a random sample in random order, the same for the same seed: its beginning is a random sample too."""
    return random.Random(seed).sample(list(mutants), min(count, len(mutants)))


def changed_line(source: str, mutated: str) -> tuple[str, str]:
    """Return the first line that differs, before and after."""
    pairs = zip(source.splitlines(), mutated.splitlines(), strict=False)
    before, after = next(((one, other) for one, other in pairs if one != other), ("", ""))
    return before.strip(), after.strip()


def _operator(name: str) -> Any:
    return get_operator(name)()
