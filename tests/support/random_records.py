"""Strategies for records of any outcome, with any text where a file's text can stand."""

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from fedora_qa.record.types import FileRecord, Finding, Record, Result, Waived, Where
from tests.support.records import file_record, record

SEVERITIES = ("critical", "error", "warning", "info")
OUTCOMES = ("passed", "failed", "warned", "not_applicable", "not_observable", "crashed")

unhurried = settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
"""A busy machine draws records slowly; that says nothing about them."""

any_text = st.text(max_size=8)
places = st.builds(
    Where,
    stream=st.none() | any_text,
    start_us=st.none() | st.floats(0, 1e9),
    frame=st.none() | st.integers(0, 10**6),
    pixel=st.none() | st.just((17, 4)),
)


def waivers_of(severity: str) -> st.SearchStrategy[Waived | None]:
    """Information may be what a waiver made of a finding."""
    waivers = st.builds(Waived, any_text, any_text, st.dates().map(str))
    return st.none() | waivers if severity == "info" else st.none()


@st.composite
def results(draw: st.DrawFn, number: int) -> Result:
    """A check with an outcome, and findings where it failed or warned: a failed one has an error, as checks do."""
    outcome = draw(st.sampled_from(OUTCOMES))
    severities = draw(st.lists(st.sampled_from(SEVERITIES), max_size=2)) if outcome in {"failed", "warned"} else []
    severities = ["error", *severities] if outcome == "failed" else severities
    findings = tuple(
        Finding(f"F{number}{i}", draw(any_text), severity, draw(any_text), draw(places), draw(waivers_of(severity)))
        for i, severity in enumerate(severities)
    )
    return Result(
        f"subject.{number}{draw(any_text)}", outcome, draw(any_text),
        findings=findings, reason=draw(any_text), traceback=draw(any_text),
    )  # fmt: skip


@st.composite
def files(draw: st.DrawFn, number: int) -> FileRecord:
    """A file with up to three checks."""
    count = draw(st.integers(0, 3))
    return file_record(*(draw(results(i)) for i in range(count)), path=f"{number}{draw(any_text)}")


@st.composite
def records(draw: st.DrawFn) -> Record:
    """A record of one or two files."""
    count = draw(st.integers(1, 2))
    return record(*(draw(files(i)) for i in range(count)))
