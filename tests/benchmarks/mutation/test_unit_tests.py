"""Each mutated module meets the tests that can notice it."""

from pathlib import Path

import pytest

from tests.benchmarks.mutation.unit_tests import modules, unit_tests_of

ROOT = Path(__file__).parents[3]


def write(root: Path, path: str, imports: str = "") -> Path:
    """A module or test that imports another."""
    target = root / path
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(f"from fedora_qa.{imports} import something\n" if imports else "")
    return target


def test_tests_that_name_the_module_come_before_those_that_reach_it(tmp_path: Path) -> None:
    """Direct importers first, then those of its users; others are left out."""
    module = write(tmp_path, "fedora_qa/estimators/flow/inner.py")
    write(tmp_path, "fedora_qa/estimators/outer.py", "estimators.flow.inner")
    write(tmp_path, "fedora_qa/judgement/other.py")
    reaching = write(tmp_path, "tests/estimators/test_a_outer.py", "estimators.outer")
    naming = write(tmp_path, "tests/estimators/flow/test_inner.py", "estimators.flow.inner")
    write(tmp_path, "tests/judgement/test_other.py", "judgement.other")
    assert unit_tests_of(module, tmp_path) == [naming, reaching]


def test_kernels_are_left_out(tmp_path: Path) -> None:
    """Compiled code is not mutated, and neither are the files that only mark packages."""
    kept = write(tmp_path, "fedora_qa/estimators/fit.py")
    for name in ("fit_kernels", "__init__"):
        write(tmp_path, f"fedora_qa/estimators/{name}.py")
    assert modules(tmp_path) == [kept]


@pytest.mark.parametrize("module", modules(ROOT), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_module_has_a_unit_test(module: Path) -> None:
    """No estimator and no part of judgement is without a unit test that reaches it."""
    assert unit_tests_of(module, ROOT)
