"""Action, hook, workflows and examples are valid by the official schemas, and do what the command does."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import pytest
import yaml

from tests.support.documented import blocks
from tests.support.handmade import write_handmade
from tests.support.releases import write_checksums, write_release

ROOT = Path(__file__).parents[2]
ACTION = ROOT / "action.yml"
HOOKS = ROOT / ".pre-commit-hooks.yaml"
EXAMPLES = ROOT / "docs" / "examples"

POLICY = """
ruleset_version = "2"
[check]
select = ["clocks.order", "index_maps"]
"""


def python_m(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a module."""
    command = [sys.executable, "-m", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


def loaded(path: Path) -> Any:
    """A YAML file's content."""
    return yaml.safe_load(path.read_text(encoding="utf-8"))


WORKFLOWS = ROOT / ".github" / "workflows"
CITATION = ROOT / "CITATION.cff"

VALIDATED = {
    "action": ("vendor.github-actions", [ACTION], "steps:"),
    "workflows": ("vendor.github-workflows", [EXAMPLES / "gate.yml", *sorted(WORKFLOWS.glob("*.yml"))], "steps:"),
    "citation": ("vendor.citation-file-format", [CITATION], "title:"),
}


@pytest.mark.parametrize(("schema", "paths", "key"), VALIDATED.values(), ids=VALIDATED.keys())
def test_valid_by_the_official_schema(schema: str, paths: list[Path], key: str, tmp_path: Path) -> None:
    """GitHub would accept it; without a key that it needs it would not, so that the validation can fail."""
    assert python_m("check_jsonschema", "--builtin-schema", schema, *paths).returncode == 0
    broken = tmp_path / paths[0].name
    broken.write_text(paths[0].read_text(encoding="utf-8").replace(key, f"x{key}"), encoding="utf-8")
    assert python_m("check_jsonschema", "--builtin-schema", schema, broken).returncode == 1


def test_workflows_run_what_there_is() -> None:
    """The targets of make that workflows name are in the Makefile; only publishing and its page may write."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    jobs = {(path.stem, name): job for path in WORKFLOWS.glob("*.yml") for name, job in loaded(path)["jobs"].items()}
    scripts = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    targets = {target for script in scripts for target in re.findall(r"^make (\w+)", script, re.MULTILINE)}
    assert targets == {"site", "wheel"}
    assert all(f"\n{target}: " in makefile for target in targets)
    assert {place for place, job in jobs.items() if "permissions" in job} == {
        ("site", "publish"),
        ("publish", "publish"),
    }
    assert all(loaded(path)["permissions"] == {"contents": "read"} for path in WORKFLOWS.glob("*.yml"))


def test_the_hook_is_valid(tmp_path: Path) -> None:
    """pre-commit accepts the hook and the documented configuration, and not what lacks an entry."""
    assert python_m("pre_commit", "validate-manifest", HOOKS).returncode == 0
    assert python_m("pre_commit", "validate-config", EXAMPLES / "pre-commit-config.yaml").returncode == 0
    broken = tmp_path / HOOKS.name
    broken.write_text(HOOKS.read_text(encoding="utf-8").replace("entry:", "entri:"), encoding="utf-8")
    assert python_m("pre_commit", "validate-manifest", broken).returncode == 1


def test_the_examples_use_what_there_is() -> None:
    """Workflow and documentation give the action inputs that it has; the configuration names the hook."""
    inputs = set(loaded(ACTION)["inputs"])
    steps = loaded(EXAMPLES / "gate.yml")["jobs"]["gate"]["steps"]
    (ours,) = (step for step in steps if step["uses"].startswith("OWNER/fedora-qa@"))
    (shown,) = yaml.safe_load(blocks("ci.md", "yaml")[0])
    assert set(ours["with"]) | set(shown["with"]) <= inputs
    told = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
    assert all(f"| `{name}` |" in told for name in inputs)
    (repository,) = loaded(EXAMPLES / "pre-commit-config.yaml")["repos"]
    assert [hook["id"] for hook in repository["hooks"]] == [hook["id"] for hook in loaded(HOOKS)]


def test_no_input_becomes_a_command() -> None:
    """No script of the action has an expression in its text: inputs come as variables of the environment."""
    scripts = [step["run"] for step in loaded(ACTION)["runs"]["steps"] if "run" in step]
    assert len(scripts) == 2
    assert not any("${{" in script for script in scripts)


def test_the_report_becomes_an_artifact() -> None:
    """The folder of all outputs is uploaded under the name that is given, unless nothing was checked."""
    action = loaded(ACTION)
    (upload,) = (step for step in action["runs"]["steps"] if "upload-artifact" in step.get("uses", ""))
    assert upload["with"]["path"] == "${{ inputs.out }}"
    assert upload["with"]["name"] == "${{ inputs.artifact }}"
    assert "inputs.artifact != ''" in upload["if"]
    assert "exit-code != '2'" in upload["if"]
    (install,) = (step for step in action["runs"]["steps"] if step.get("name") == "Install fedora-qa")
    assert '"$SOURCE[reports]"' in install["run"]


def gated(folder: Path, **inputs: str) -> tuple[int, dict[str, str], str]:
    """Run the action's gate as GitHub does; return its exit code, outputs and summary."""
    (step,) = (step for step in loaded(ACTION)["runs"]["steps"] if step.get("id") == "gate")
    defaults = {name: declared.get("default", "") for name, declared in loaded(ACTION)["inputs"].items()}
    given = {
        name: (defaults | inputs)[expression[len("${{ inputs.") : -len(" }}")]]
        for name, expression in step["env"].items()
    }
    bin_folder = folder / "bin"
    bin_folder.mkdir()
    command = bin_folder / "fedora-qa"
    command.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m fedora_qa "$@"\n')
    command.chmod(0o755)
    output, summary = folder / "output", folder / "step-summary"
    environment = os.environ | given | {
        "PATH": f"{bin_folder}:{os.environ['PATH']}",
        "GITHUB_OUTPUT": str(output),
        "GITHUB_STEP_SUMMARY": str(summary),
    }  # fmt: skip
    script = folder / "script.sh"
    script.write_text(step["run"], encoding="utf-8")
    shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(script)]
    done = subprocess.run(shell, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    outputs = dict(line.split("=", 1) for line in output.read_text().splitlines())
    return done.returncode, outputs, summary.read_text() if summary.exists() else ""


@pytest.fixture
def release(tmp_path: Path) -> Path:
    """A release of two sequences in a folder with a blank and a leading dash, and its policy beside it."""
    write_release(tmp_path / "-my release", "a.h5", "b.h5")
    (tmp_path / "policy.toml").write_text(POLICY)
    return tmp_path / "-my release"


def test_the_action_lets_a_clean_release_pass(release: Path) -> None:
    """Exit code, summary, certificate, and the files that its outputs name."""
    code, outputs, summary = gated(release.parent, path=release.name, certificate="certificate.json")
    assert (code, outputs["exit-code"]) == (0, "0")
    assert "CLEAN" in summary
    assert (release.parent / "certificate.json").is_file()
    assert all((release.parent / outputs[name]).is_file() for name in ("html", "record", "junit", "sarif", "badge"))


def test_the_action_fails_with_the_gate(release: Path) -> None:
    """A finding fails the step, and the summary shows it."""
    with h5py.File(release / "b.h5", "r+") as file:
        timestamps = file["path/imu/ts"]
        assert isinstance(timestamps, h5py.Dataset)
        timestamps[20:22] = timestamps[20:22][::-1]
    write_checksums(release, "a.h5", "b.h5")
    code, outputs, summary = gated(release.parent, path=release.name)
    assert (code, outputs["exit-code"]) == (1, "1")
    assert "clocks.order" in summary


def test_the_action_tells_misuse(release: Path) -> None:
    """A policy that is not there is misuse, and nothing is said of the release."""
    code, outputs, summary = gated(release.parent, path=release.name, policy="none.toml")
    assert (code, outputs["exit-code"], summary) == (2, "2", "")


def test_the_hook_checks_what_it_is_given(tmp_path: Path) -> None:
    """The hook's entry is a command of the package, its pattern finds sequences, and it fails on a finding."""
    (hook,) = loaded(HOOKS)
    program, *arguments = shlex.split(hook["entry"])
    assert program == "fedora-qa"
    path = write_handmade(tmp_path / "a.h5")
    assert python_m("fedora_qa", *arguments, "--select", "clocks.order", path).returncode == 0
    with h5py.File(path, "r+") as file:
        timestamps = file["path/imu/ts"]
        assert isinstance(timestamps, h5py.Dataset)
        timestamps[20:22] = timestamps[20:22][::-1]
    assert python_m("fedora_qa", *arguments, "--select", "clocks.order", path).returncode == 1
