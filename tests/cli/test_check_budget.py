"""``fedora-qa check --budget``: what can be asked, and what the record says of it."""

import json
from pathlib import Path
from typing import Any

import pytest

from fedora_qa.cli.options import parse_budget
from fedora_qa.errors import MisuseError
from tests.cli.conftest import Command

SELECT = ("--select", "clocks", "--select", "depth")


@pytest.mark.parametrize(("text", "seconds"), [("60s", 60), ("5m", 300), ("0.5h", 1800), (" 1.5S ", 1.5)])
def test_amounts_of_time(text: str, seconds: float) -> None:
    """Seconds, minutes and hours."""
    assert parse_budget(text).seconds == seconds


@pytest.mark.parametrize("text", ["", "60", "0s", "-5s", "5d", "1e3s", "s"])
def test_no_amount_of_time(text: str) -> None:
    """A number without a unit, or no time at all, is misuse."""
    with pytest.raises(MisuseError, match="such as 60s"):
        parse_budget(text)


@pytest.mark.parametrize("other", [("--effort", "quick"), ("--canary",)])
def test_what_a_budget_does_not_go_with(other: tuple[str, ...], fedora_qa: Command, sequence: Path) -> None:
    """Two answers to how much to look at, and canaries, are misuse in one sentence."""
    done = fedora_qa("check", sequence, "--budget", "60s", *other)
    assert done.code == 2
    assert done.err.count("\n") == 1


def record_of(path: Path) -> dict[str, Any]:
    record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return record


def test_the_run_says_what_was_reached(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """Record and summary name the budget and how far it carried."""
    target = tmp_path / "out.json"
    done = fedora_qa("check", sequence, "--budget", "10m", *SELECT, "--json", target)
    record = record_of(target)
    reached = record["run"]["host"]["budget_reached"]
    assert done.code == 0
    assert record["run"]["host"]["budget_s"] == 600.0
    assert record["effort"] == "budget 10m"
    assert reached.startswith("1 of 1 windows at the density of ")
    assert f"budget 10m: {reached}" in " ".join(done.out.split())


def test_what_is_kept_is_of_one_budget(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A run is resumed with its own budget alone, and then says what was reached at that time."""
    kept, target = tmp_path / "kept", tmp_path / "out.json"

    def reached(*options: str) -> str:
        fedora_qa("check", sequence, *options, *SELECT, "--resume", kept, "--json", target)
        return str(record_of(target)["run"]["host"].get("budget_reached"))

    first = reached("--budget", "10m")
    assert reached("--budget", "10m") == first
    assert reached("--budget", "11m") != first
    assert reached() == "None"


def test_never_clean_on_less_than_is_required(
    fedora_qa: Command, sequence: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a budget leaves less seen than the configuration requires, the file is incomplete."""
    monkeypatch.setattr("fedora_qa.engine.plan.WINDOW_NS", 5_000_000)
    config = tmp_path / "fedora-qa.toml"
    config.write_text("[required_coverage]\ndepth = 0.9\n")
    done = fedora_qa("check", sequence, "--budget", "0.01s", "--select", "depth", "--config", config)
    assert done.code == 3
    assert "less was seen than required" in done.out
    assert "the least that is always looked at" in " ".join(done.out.split())
