"""Confidence is a measured frequency, of enough diagnoses, or 0."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from fedora_qa.diagnosis import conclusion
from fedora_qa.diagnosis.candidates import CauseCandidate
from fedora_qa.diagnosis.conclusion import FEWEST, confidence_of, is_conclusive
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.power.detection_power import write_confidence
from fedora_qa.power.tables import power_of
from tests.support.studies import ORIGIN, study


@pytest.fixture
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The path of the table that is read, without a table."""
    monkeypatch.setattr(conclusion, "PUBLISHED", tmp_path / "confidence.json")
    conclusion._published.cache_clear()
    yield tmp_path / "confidence.json"
    conclusion._published.cache_clear()


def test_nothing_measured_is_no_confidence(published: Path) -> None:
    """Without a study there is no number."""
    assert not published.exists()
    assert confidence_of("confirmed", "time_offset") == 0.0


def test_a_cause_with_few_diagnoses_takes_the_frequency_of_its_status(published: Path) -> None:
    """Enough diagnoses of a cause give its own frequency, fewer that of the status; a status with few gives none."""
    rows = [
        ("confirmed", "", 90, 100),
        ("confirmed", "time_offset", FEWEST - 1, FEWEST),
        ("confirmed", "gyro_bias", 1, FEWEST - 1),
        ("suggested", "", 3, FEWEST - 1),
    ]
    published.write_text(json.dumps(rows), "utf-8")
    assert confidence_of("confirmed", "time_offset") == (FEWEST - 1) / FEWEST
    assert confidence_of("confirmed", "gyro_bias") == 0.9
    assert confidence_of("confirmed", "mirrored") == 0.9
    assert confidence_of("suggested", "mirrored") == 0.0


def test_a_study_publishes_what_is_read(published: Path) -> None:
    """The frequency over all found trials of a study is the confidence of its status."""
    trials = study()
    write_confidence(power_of(trials, ORIGIN), published)
    named = [trial.checked.diagnoses for trial in trials if trial.checked.diagnoses]
    right = sum(diagnoses[0].name == "events:time_offset" for diagnoses in named)
    assert len(named) >= FEWEST
    assert confidence_of("suggested", "time_offset") == right / len(named)


@pytest.mark.parametrize(("code", "conclusive"), [("imu.rotation.bias", True), ("imu.rotation.residual", False)])
def test_undoing_the_mean_of_a_bias_does_not_rule_out_one_that_walks(code: str, *, conclusive: bool) -> None:
    """What a constant bias leaves is that of a walking one."""
    codes = {"F1": "imu.rotation.bias", "F2": code}
    evidence = {finding: Hypothesis("gyro_bias", "imu", 0.5) for finding in codes}
    candidate = CauseCandidate("gyro_bias", "imu", evidence, dict.fromkeys(codes, 0.5))
    assert is_conclusive(candidate, codes) is conclusive
