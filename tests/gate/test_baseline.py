"""What an earlier gate found is known; what is new, more, or grown worse is not."""

from dataclasses import replace

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.gating.acceptance import accept_known, baseline_of
from fedora_qa.record.types import FileRecord, Measurement, Record, Result, Where
from tests.support.records import failed, file_record, passed, record

RATE = 1e-4


def release_of(*files: FileRecord, folder: str = "data") -> Record:
    """A gate's record: the files in a folder, and the release."""
    names = [replace(file, path=f"{folder}/{i}.h5") for i, file in enumerate(files)]
    return record(*names, file_record(passed("release.documents"), path=folder))


def offset_of(value: float | None, standard_error: float = 0.1) -> Result:
    """A failed check that measured this offset."""
    measured = Measurement("offset", value, "ms", standard_error, 0.0, 0.16, 0.21)
    return replace(failed(), measurements=(measured,))


def accepted(now: Result, before: Result) -> Result:
    """The check as the baseline has it; the two releases lie in different folders."""
    baseline = baseline_of(release_of(file_record(before), folder="old/place"))
    return accept_known("0.h5", file_record(now), baseline, RATE).results[0]


def test_a_known_finding_warns() -> None:
    """The same finding in the same file is a warning that says so."""
    result = accepted(failed(), failed())
    assert result.outcome == "warned"
    assert result.findings[0].severity == "warning"
    assert result.findings[0].message.endswith("Known from the baseline.")


def test_what_was_known_stays_known() -> None:
    """The record of a gate with a baseline is a baseline for the next one."""
    assert accepted(failed(), accepted(failed(), failed())).outcome == "warned"


@pytest.mark.parametrize(("value", "outcome"), [(2.0, "warned"), (-2.0, "warned"), (2.4, "warned"), (2.7, "failed"),
                                                (None, "failed")])  # fmt: skip
def test_what_has_grown_worse_is_not_known(value: float | None, outcome: str) -> None:
    """2 ms with errors of 0.1 ms: one-sided at 1e-4 (3.72 sigma of 0.141 ms) growth counts from 0.53 ms on."""
    result = accepted(offset_of(value), offset_of(2.0))
    assert result.outcome == outcome
    assert result.findings[0].message.endswith("Known from the baseline." if outcome == "warned" else "the baseline.")


@pytest.mark.parametrize(("known", "outcome"), [(("flow/10hz", "flow/25hz"), "warned"), (("flow/10hz",), "failed")])
def test_a_finding_is_known_at_all_its_places_or_not_at_all(known: tuple[str, ...], outcome: str) -> None:
    """A baseline of an earlier version has a finding for each rate; one with several places needs all of them."""
    first = failed().findings[0]
    apart = [replace(first, id=f"F{i}", where=Where(stream=stream)) for i, stream in enumerate(known)]
    joined = replace(first, where=Where(stream="flow/25hz"), places=(Where(stream="flow/10hz"),))
    result = accepted(replace(failed(), findings=(joined,)), replace(failed(), findings=tuple(apart)))
    assert result.outcome == outcome


def test_one_more_of_a_kind_is_new() -> None:
    """Two findings of a rule where the baseline has one: one is known, the other fails."""
    first, warning = failed().findings
    result = accepted(replace(failed(), findings=(first, replace(first, id="F3"), warning)), failed())
    assert result.outcome == "failed"
    assert [finding.severity for finding in result.findings] == ["warning", "error", "warning"]


NEW = {
    "another code": replace(failed().findings[0], code="event_response.timing.jitter"),
    "another stream": replace(failed().findings[0], where=replace(failed().findings[0].where, stream="rgb")),
}


@pytest.mark.parametrize("finding", NEW.values(), ids=NEW.keys())
def test_new_findings_fail(finding: object) -> None:
    """A finding of another rule or stream is not known."""
    now = replace(failed(), findings=(finding,))
    assert accepted(now, failed()) == now


def test_another_file_is_new() -> None:
    """A finding that another file of the release had is not known."""
    baseline = baseline_of(release_of(file_record(passed()), file_record(failed())))
    file = file_record(failed())
    assert accept_known("0.h5", file, baseline, RATE) == file
    assert accept_known("1.h5", file, baseline, RATE).results[0].outcome == "warned"


def test_what_was_waived_is_not_known() -> None:
    """Information in the baseline, which a waiver made of a finding, accepts nothing once the waiver is gone."""
    first, warning = failed().findings
    waived = replace(failed(), outcome="warned", findings=(replace(first, severity="info"), warning))
    assert accepted(failed(), waived) == failed()


def test_only_a_gate_writes_baselines() -> None:
    """The record of a check does not know what is the release."""
    with pytest.raises(MisuseError, match="gate --json"):
        baseline_of(record())


@pytest.mark.parametrize("path", ["elsewhere/a.h5", "/a.h5"])
def test_a_record_with_files_outside_of_its_release(path: str) -> None:
    """Names lead out of the folder: it is no record of a gate."""
    release = file_record(Result("release.totals", "passed", "?"), path="out/v2")
    with pytest.raises(MisuseError, match="without a release"):
        baseline_of(record(file_record(path=path), release))
