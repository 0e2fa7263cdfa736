"""Which of two streams a deviation belongs to, by the timestamps of all streams and by what is declared."""

from dataclasses import replace

import pytest

from fedora_qa.diagnosis.imu import TimingCues, gravity_likelihoods, timing_cues_of
from fedora_qa.sequence.facts import Facts
from tests.support.facts import MS, clock, exact_facts, with_clock

US = 1000


def moved(stream: str, offset_ns: int, facts: Facts | None = None) -> Facts:
    facts = facts or exact_facts()
    return with_clock(facts, stream, clock(facts.clocks[stream].times_ns + offset_ns))


def later_of(timing_cues: TimingCues) -> str:
    """The stream that the clues blame, or neither."""
    if timing_cues.imu_offset == timing_cues.pose_offset:
        return "neither"
    return "imu" if timing_cues.imu_offset > timing_cues.pose_offset else "pose"


@pytest.mark.parametrize("offset_ns", [3 * US, -7 * US, 1 * MS, 10 * MS, 40 * MS])
@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_the_clock_that_left_the_frames_is_the_late_one(stream: str, offset_ns: int) -> None:
    """Frames fall on the stamps of the stream that stayed, or begin with it where the offset is a whole period."""
    assert later_of(timing_cues_of(moved(stream, offset_ns))) == stream


@pytest.mark.parametrize("stream", ["imu", "pose"])
def test_without_frames_the_grid_of_timestamps_tells(stream: str) -> None:
    """With IMU and pose alone, the stream whose stamps are multiples of its period stayed."""
    facts = exact_facts()
    alone = replace(facts, clocks={name: facts.clocks[name] for name in ("imu", "pose")})
    assert later_of(timing_cues_of(moved(stream, 3 * US, alone))) == stream


def test_clocks_that_all_stay_or_all_left_tell_nothing() -> None:
    """Equal treatment leaves both alike: a synchronous file, and one whose every clock has its own phase."""
    assert later_of(timing_cues_of(exact_facts())) == "neither"
    assert later_of(timing_cues_of(moved("imu", 3 * US, moved("pose", 17 * US)))) == "neither"


@pytest.mark.parametrize(("declared", "excess", "error", "blamed"), [
    (9.80665, 5e-5, 2e-6, "imu"),
    (9.80670, -5e-5, 2e-6, "metadata"),
    (9.80665, 0.3, 0.03, "imu"),
    (10.1, -0.3, 0.03, "metadata"),
])  # fmt: skip
def test_an_unusual_gravity_is_the_wrong_one(declared: float, excess: float, error: float, blamed: str) -> None:
    """Of measured and declared gravity the one that nobody uses is blamed; an uncertain one gets the benefit."""
    sensor, declaration = gravity_likelihoods(declared, excess, error)
    assert ("imu" if sensor >= declaration else "metadata") == blamed
