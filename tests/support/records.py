"""Records of imaginary files, to be written, read and shown."""

from dataclasses import replace

from fedora_qa.record.sarif import RuleHelp
from fedora_qa.record.types import (
    RECORD_VERSION,
    Coverage,
    Diagnosis,
    FileRecord,
    Finding,
    Measurement,
    Record,
    Result,
    Run,
    Tool,
    Waived,
    Where,
)

LATE = Where(stream="events", start_us=0.0, stop_us=2_000_000.0)
HOT = Where(stream="events", pixel=(17, 4))

HELPS = {
    "event_response.timing": RuleHelp(
        description="The time by which events are late.",
        text="The time by which events are late.\n\nWhy it matters\nA network learns it.",
        markdown="The time by which events are late.\n\n## Why it matters\n\nA network learns it.",
    )
}
"""Of the check of ``failed``, and of no other."""


def passed(check: str = "clocks.order") -> Result:
    """A check that passed and saw everything."""
    measured = Measurement("backward_steps", 0.0, "samples", 0.0, 0.0, 0.0, 1.0, code="clocks.order.backward_steps")
    return Result(check, "passed", "Do stamps advance?", (measured,), Coverage(101, 101, "frames"))


def immaterial() -> Result:
    """A check that passes with a deviation that is certain and does not matter."""
    finding = Finding(
        "F1", "pose.orientation.immaterial", "info",
        "Measurable, not material: length_error deviates by 3e-06.",
        Where(stream="pose"),
    )  # fmt: skip
    measured = Measurement("length_error", 3e-6, "1", 0.0, 0.0, 4.4e-16, 1e-5, material=1e-5,
                           code="pose.orientation.length")  # fmt: skip
    return Result("pose.orientation", "passed", "Are quaternions of unit length?", (measured,),
                  Coverage(201, 201, "poses"), (finding,))  # fmt: skip


def failed() -> Result:
    """A check with one finding and one warning."""
    return Result(
        check="event_response.timing",
        outcome="failed",
        question="Do events come when the light changes?",
        measurements=(
            Measurement("threshold", 0.2001, "nat", 0.0002, 0.2, 0.001, 0.0015, code="event_response.model.domain"),
            Measurement("offset", 2.0634, "ms", 0.031, 0.0, 0.16, 0.21, code="event_response.timing.offset"),
        ),
        coverage=Coverage(12, 101, "frames"),
        findings=(
            Finding("F1", "event_response.timing.offset", "error", "Events are 2.06 ± 0.03 ms late.", LATE),
            Finding("F2", "event_response.timing.night", "warning", "The frames are dark.", Where()),
        ),
    )


def waived() -> Result:
    """The check of ``failed`` where its finding is waived."""
    found = failed()
    message = "Events are 2.06 ± 0.03 ms late. Waived until 2026-06-30 by anna: known latency"
    accepted = Waived("anna", "known latency", "2026-06-30")
    finding = replace(found.findings[0], severity="info", message=message, waived=accepted)
    return replace(found, outcome="warned", findings=(finding, *found.findings[1:]))


def crashed() -> Result:
    """A check that failed itself."""
    trace = "Traceback (most recent call last):\nZeroDivisionError: division by zero\n"
    reason = "the check itself failed: ZeroDivisionError: division by zero"
    return Result("imu.noise", "crashed", "Is the noise what is declared?", reason=reason, traceback=trace)


def not_observable() -> Result:
    """A check that this sequence cannot answer."""
    return Result("imu.timing", "not_observable", "Are IMU and pose on one clock?", reason="the vehicle hovers")


def late_events() -> Diagnosis:
    """The cause of the finding of ``failed``."""
    return Diagnosis(
        id="D1",
        cause="time_offset",
        stream="events",
        magnitude=2.0634,
        unit="ms",
        standard_error=0.031,
        confidence=0.87,
        where=LATE,
        remedy="Subtract the offset from the stamps.",
        explains=("F1",),
        status="confirmed",
        tried=("events 2.063 ms earlier",),
        cleared=("F1",),
        windows=4,
    )


def file_record(*results: Result, path: str = "seq.h5", diagnoses: tuple[Diagnosis, ...] = ()) -> FileRecord:
    """The record of a file with these results; its verdict follows from them."""
    outcomes = {result.outcome for result in results}
    grave = "findings" if "failed" in outcomes else "clean"
    return FileRecord(
        path=path,
        size=51_300_000,
        sha256="0123456789abcdef" * 4,
        digest_kind="full",
        dialect="fedora",
        inferred={"flow_unit": "px"},
        statistics={"sequence": {"duration_s": 2.0, "event_rate_mean_per_s": None}},
        verdict="incomplete" if "crashed" in outcomes else grave,
        results=results,
        diagnoses=diagnoses,
        evidence={"offset_by_frame": "Offset of the events at each frame, ms"},
    )


def record(*files: FileRecord) -> Record:
    """A record of these files, or of one file in which events are late."""
    return Record(
        record_version=RECORD_VERSION,
        ruleset_version="1",
        tool=Tool("fedora-qa", "0.1.0"),
        config_digest="0" * 64,
        run=Run("2024-05-01T12:00:00+00:00", {"measuring": 1.25, "check imu.noise": 0.5}, {"cores": 2}),
        files=files or (file_record(failed(), passed(), not_observable(), diagnoses=(late_events(),)),),
        effort="full",
    )
