"""What a passed check is worth is what was measured, and says when it is out of date."""

from dataclasses import replace
from pathlib import Path

import pytest

from fedora_qa.cli.published_studies import detection_power_text, pass_detection_power
from fedora_qa.errors import MisuseError
from fedora_qa.power.detection_power import (
    detection_power_of,
    estimators_digest,
    read_detection_power,
    write_detection_power,
)
from fedora_qa.power.tables import power_of
from fedora_qa.record.power_study import Estimate, Share
from fedora_reports.detection_power import NOTHING_KNOWN
from tests.support.studies import CHECK, ORIGIN, study

POWER = power_of(study(), ORIGIN)


def test_what_a_pass_is_worth(tmp_path: Path) -> None:
    """Written and read again, the table says at which size a check finds a cause 95% of the time."""
    write_detection_power(detection_power_of(POWER), tmp_path / "published.json")
    detection_power = read_detection_power(tmp_path / "published.json")
    assert detection_power == detection_power_of(POWER)
    assert detection_power is not None
    (found,) = detection_power.of(CHECK)
    assert (found.cause, found.unit, found.at_95) == ("events:time_offset", "ms", POWER.detections[1].curve.at_95)
    assert detection_power.of("imu.timing") == ()


def test_a_stale_table_is_noticed() -> None:
    """A table belongs to the code that it was measured with."""
    detection_power = detection_power_of(POWER)
    assert not detection_power.is_stale()
    assert not detection_power.is_stale(estimators_digest())
    assert detection_power.is_stale("0" * 64)
    assert replace(detection_power, estimators_digest="0" * 64).is_stale()


def test_no_table_and_a_damaged_one(tmp_path: Path) -> None:
    """Where none has been published there is none; a damaged one is an error."""
    assert read_detection_power(tmp_path / "published.json") is None
    (tmp_path / "published.json").write_text("{")
    with pytest.raises(MisuseError, match="run `make power`"):
        read_detection_power(tmp_path / "published.json")


def test_explain_says_what_a_pass_is_worth(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sizes stand in words, with a warning where the code has changed since; without a table nothing is said."""
    published = detection_power_of(POWER)
    monkeypatch.setattr("fedora_qa.cli.published_studies.read_detection_power", lambda: published)
    assert "events:time_offset: 95% at 0.8" in detection_power_text(CHECK)
    assert "has changed" not in detection_power_text(CHECK)
    assert "No cause" in detection_power_text("imu.timing")
    monkeypatch.setattr(
        "fedora_qa.cli.published_studies.read_detection_power", lambda: replace(published, estimators_digest="0")
    )
    assert "The code has changed since" in detection_power_text(CHECK)
    monkeypatch.setattr("fedora_qa.cli.published_studies.read_detection_power", lambda: None)
    assert detection_power_text(CHECK) == ""


def test_a_report_gets_all_of_it_with_the_best_check_of_each_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two checks that find a cause the best finds it from a smaller size on, or at every size that was tried."""
    published = detection_power_of(POWER)
    known = next(one for one in published.found if one.check == CHECK and one.at_95.value is not None)
    blunter = replace(known, check="imu.timing", at_95=replace(known.at_95, value=9.0))
    surer = replace(
        known, cause="rgb:unsorted", found=Share(4, 4, 0.4, 1.0), at_95=Estimate(None, None, None), check="clocks.order"
    )
    unsure = replace(surer, check="clocks.rate", found=Share(3, 4, 0.2, 0.99))
    both = replace(published, found=(blunter, known, unsure, surer))
    monkeypatch.setattr("fedora_qa.cli.published_studies.read_detection_power", lambda: both)
    handed_over = pass_detection_power()
    assert {(one.cause, one.check, one.best) for one in handed_over.causes} == {
        (known.cause, "imu.timing", False),
        (known.cause, CHECK, True),
        ("rgb:unsorted", "clocks.order", True),
    }
    assert [one.text for one in handed_over.causes if one.cause == "rgb:unsorted"] == ["found 4 of 4 (100.0%)"]
    assert "short and small files" in handed_over.source
    monkeypatch.setattr("fedora_qa.cli.published_studies.read_detection_power", lambda: None)
    assert pass_detection_power() == NOTHING_KNOWN
