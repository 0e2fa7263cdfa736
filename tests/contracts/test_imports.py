"""The layers hold, and each contract can fail."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

VIOLATIONS = {
    "qa-stands-alone": ("fedora_qa/geometry/planted.py", "import fedora_generator"),
    "generator-names-only": ("generator/fedora_generator/planted.py", "import fedora_qa.geometry"),
    "reports-read-records": ("reports/fedora_reports/planted.py", "import fedora_qa.sequence"),
    "mathematics-without-files": ("fedora_qa/estimators/planted.py", "import h5py"),
    "measurements-name-no-cause": ("fedora_qa/estimators/planted.py", "import fedora_qa.causes"),
    "record-without-arrays": ("fedora_qa/record/planted.py", "import numpy"),
    "layers": ("fedora_qa/checks/planted.py", "import fedora_qa.engine"),
    "engine-layers": ("fedora_qa/engine/trials/planted.py", "import fedora_qa.engine.tasks"),
    "independent-subjects": ("fedora_qa/checks/depth/planted.py", "import fedora_qa.checks.images.order"),
    "no-graphics": ("fedora_qa/sequence/planted.py", "import pyvista"),
}


def lint_imports(tree: Path, *contracts: str) -> subprocess.CompletedProcess[str]:
    """Run import-linter on a tree in a process of its own, so that the tree's packages are the ones imported."""
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    for contract in contracts:
        command += ["--contract", contract]
    paths = [str(tree), str(tree / "generator"), str(tree / "reports")]
    environment = {"PYTHONPATH": ":".join(paths), "PATH": "/usr/bin:/bin", "HOME": str(tree)}
    return subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of the source tree."""
    for part in ("fedora_qa", "generator", "reports", "pyproject.toml"):
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, tmp_path / part)
    return tmp_path


def test_every_contract_holds() -> None:
    """Imports run one way."""
    done = lint_imports(ROOT)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("contract", VIOLATIONS)
def test_contract_can_fail(contract: str, tree: Path) -> None:
    """A planted import breaks exactly the contract that forbids it, and the contract names it."""
    path, line = VIOLATIONS[contract]
    (tree / path).write_text(line + "\n")
    done = lint_imports(tree, contract)
    assert done.returncode != 0
    assert "planted" in done.stdout


def test_every_contract_has_a_violation() -> None:
    """No contract is without a proof that it can fail."""
    declared = {
        line.split('"')[1] for line in (ROOT / "pyproject.toml").read_text().splitlines() if line.startswith("id = ")
    }
    assert declared == set(VIOLATIONS)
