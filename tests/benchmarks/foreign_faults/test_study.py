"""The study of foreign faults: what it plants, keeps, counts and writes."""

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.benchmarks.foreign.scenes import Size
from tests.benchmarks.foreign_faults import study
from tests.benchmarks.foreign_faults.kind import EXACT_SCENES
from tests.benchmarks.foreign_faults.outcome import Named, Outcome, diagnose_planted, outcome_of
from tests.benchmarks.foreign_faults.page import page
from tests.benchmarks.foreign_faults.small_sources import BY_NAME
from tests.benchmarks.foreign_faults.sources import SPAN_S, Source
from tests.benchmarks.foreign_faults.table import KINDS

WHOLE_CHAIN = ("gyro in deg/s", "quaternions w first")


@pytest.mark.parametrize("name", WHOLE_CHAIN)
def test_a_kind_goes_through_the_whole_chain(
    name: str, clean_of: Callable[[Source], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is planted, found and named; the outcome is kept and read again, and the faulty file is not."""
    kind, source = BY_NAME[name], Source("park-day", 0)
    assert not kind.held_out
    clean, donor = clean_of(source), clean_of(source.donor)
    outcome = diagnose_planted(kind, source, tmp_path, clean, donor)
    assert outcome.is_found
    assert outcome.is_first_right(kind)
    assert outcome.crashed == ()
    assert [path.suffix for path in tmp_path.iterdir()] == [".json"]
    monkeypatch.delattr("tests.benchmarks.foreign_faults.outcome.check_file")
    assert diagnose_planted(kind, source, tmp_path, clean, donor) == outcome


def test_the_study_leaves_out_what_is_held_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without --held-out; and it plants in the scenes of a kind alone."""
    planted: list[str] = []

    def diagnose(folder: Path, item: tuple[str, Source]) -> Outcome:
        planted.append(f"{item[0]} {item[1].scene}")
        return said(item[0])

    monkeypatch.setattr(study, "KEPT", tmp_path)
    monkeypatch.setattr(study, "_write_clean", lambda *_: None)
    monkeypatch.setattr(study, "_diagnose", diagnose)
    monkeypatch.setattr(study, "in_processes", lambda processes, work, items, report: [work(item) for item in items])
    ended = CliRunner().invoke(study.main, ["--scenes", "park-noisy", "--seeds", "1", "--page", str(tmp_path / "a.md")])
    assert ended.exit_code == 0, ended.output
    wanted = [kind for kind in KINDS if not kind.held_out and "park-noisy" in kind.scenes]
    assert planted == [f"{kind.name} park-noisy" for kind in wanted]
    text = (tmp_path / "a.md").read_text(encoding="utf-8")
    assert not [kind.name for kind in KINDS if kind.held_out and f"| {kind.name} |" in text]
    planted.clear()
    assert CliRunner().invoke(study.main, ["--seeds", "1", "--held-out"]).exit_code == 0
    assert planted == [f"{kind.name} {scene}" for scene in SPAN_S for kind in KINDS if scene in kind.scenes]


def said(kind: str, *names: str, seed: int = 0, status: str = "suggested", failed: tuple[str, ...] = ("a",)) -> Outcome:
    diagnoses = tuple(Named(*name.split(":"), None, "", status) for name in names)
    return Outcome(kind, "park-day", seed, 0.0, 0.0, 1.0, "findings", failed, (), diagnoses)


def test_right_is_strict() -> None:
    """Cause and stream; a rate of flow is flow; where the truth has no name, none is right."""
    bgr = BY_NAME["BGR"]
    assert said("BGR", "rgb:channel_order").is_first_right(bgr)
    assert not said("BGR", "events:channel_order").is_first_right(bgr)
    assert not said("BGR").is_first_right(bgr)
    assert said("BGR", "rgb:vignetting", "rgb:channel_order").is_second_right(bgr)
    flow = BY_NAME["flow in px/s"]
    assert said("flow in px/s", "flow/25hz:flow_unit").is_first_right(flow)
    assert not said("flow in px/s", "flow/25hz:flow_unit", "flow:flow_unit").is_second_right(flow)
    nameless = BY_NAME["pose smoothed"]
    assert said(nameless.name).is_first_right(nameless)
    assert said(nameless.name, "pose:unknown").is_first_right(nameless)
    assert not said(nameless.name, "pose:noise_misdeclared").is_first_right(nameless)
    two = BY_NAME["BGR, and events late"]
    assert said(two.name, "events:time_offset", "rgb:channel_order").are_all_named(two)
    assert not said(two.name, "events:time_offset", "rgb:vignetting").are_all_named(two)


def test_an_outcome_survives_json() -> None:
    """With its diagnoses."""
    outcome = said("BGR", "rgb:channel_order", "rgb:vignetting")
    values = {name: getattr(outcome, name) for name in Outcome.__slots__}
    diagnoses = [{name: getattr(named, name) for name in Named.__slots__} for named in outcome.diagnoses]
    assert outcome_of({**values, "failed": ["a"], "crashed": [], "diagnoses": diagnoses}) == outcome


def test_the_page_counts_apart() -> None:
    """Kinds with a name and without, found and named, and what was named instead; the status of the first."""
    kinds = [BY_NAME["vignetting"], BY_NAME["dead columns"], BY_NAME["lens distortion"]]
    assert not any(kind.held_out for kind in kinds)
    outcomes = [
        said("vignetting", "rgb:vignetting", status="confirmed"),
        said("vignetting", "rgb:time_offset", "rgb:vignetting", seed=1, status="confirmed"),
        said("dead columns", failed=()),
        said("lens distortion", "rgb:unknown"),
    ]
    text = "".join(page(kinds, outcomes, Size()))
    # Clopper and Pearson for one of two, 95%: the lower bound solves 1 - (1 - p)^2 = 0.025.
    assert "| looked at | all with a name | 2 | 3 | 2 | 67% | 1 | 50% | 1% to 99% | 100% |" in text
    assert "| looked at | no name | 1 | 1 | 1 | 100% | 1 | 100% |" in text
    assert "| rgb:vignetting | 2 | 2 | 1 | 1 | rgb:time_offset 1 |" in text
    assert "| looked at | confirmed | 2 | 1 | 50% | 1% to 99% |" in text


def test_geometry_is_computed_where_the_pose_is_exact() -> None:
    """Flow that is computed from depth and pose needs both without noise."""
    assert all(BY_NAME[name].scenes == EXACT_SCENES for name in ("backward flow", "flow of another centre"))
