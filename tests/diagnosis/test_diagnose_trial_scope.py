"""What a trial excludes: nothing outside of the values, the windows and the part of the file that it alters."""

from dataclasses import replace

import pytest

from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.faults.clocks import ClockShift
from tests.support.explained_alarms import IS_LATE, LATE, alarm, diagnoses_of, undo_trial


def test_what_another_fault_leaves_excludes_nothing() -> None:
    """The windows of a trial show only a finding that the cause would not explain."""
    late = Hypothesis("time_offset", "events", 0.8, 2.0, "ms", 0.1)
    lost = Hypothesis("dropped_samples", "depth", 0.5)
    explained = [alarm(1, late, code="event_response.timing.offset"), alarm(2, lost, code="clocks.gaps.gap")]
    of_other, of_own = ({IS_LATE: undo_trial(left={finding: 1.0})} for finding in ("F2", "F1"))
    assert [(d.cause, d.status) for d in diagnoses_of(explained, of_other)] == [
        ("dropped_samples", "supported"),
        ("time_offset", "suggested"),
    ]
    assert "time_offset" not in {d.cause for d in diagnoses_of(explained, of_own)}


def test_unaltered_values_do_not_excuse_what_is_declared() -> None:
    """Undoing the polarity of values breaks them where the declaration is what is wrong."""
    opposite = alarm(1, Hypothesis("polarity_inverted", "events", 1.0), code="metadata.complete.malformed")
    of_values = {
        ("polarity_inverted", "events"): undo_trial(left={"F1": 1.0}, caused=("event_response.orientation.other",))
    }
    assert [(d.cause, d.status) for d in diagnoses_of([opposite], of_values)] == [("polarity_inverted", "supported")]


def test_frames_that_were_moved_out_of_the_windows_repeat_nothing_there() -> None:
    """Frames that repeat bit by bit do so at any time: a delay that clears them clears nothing of them."""
    late = Hypothesis("time_offset", "rgb", 0.6, 40.0, "ms")
    explained = [
        alarm(1, Hypothesis("frozen_frames", "rgb", 0.9, 8.0, "samples"), late, code="images.repeats.frames"),
        alarm(2, Hypothesis("frozen_frames", "rgb", 0.7), late, code="images.order.share"),
    ]
    first, *_ = diagnoses_of(explained, {("time_offset", "rgb"): undo_trial("F1", "F2", size=40.0)})
    assert first.cause == "frozen_frames"


def test_what_a_check_measures_comes_before_what_leaves_it_in_the_whole_file() -> None:
    """Frames in another order have no clock that is late: moved in the whole file, all of it stays."""
    late = Hypothesis("time_offset", "rgb", 0.7, 20.0, "ms")
    of_order = Hypothesis("swapped_frames", "rgb", 0.6, 2.0, "samples")
    explained = [
        alarm(1, late, code="flow_photometric.residual.tile", stream="rgb"),
        alarm(2, late, code="flow_photometric.residual.field", stream="rgb"),
        alarm(3, replace(late, support=0.2), of_order, code="images.order.part", stream="rgb"),
    ]
    explained = [(a, (*h, replace(of_order, support=0.3)) if len(h) == 1 else h) for a, h in explained]
    assert diagnoses_of(explained)[0].cause == "time_offset"
    left = {"F1": 1.06, "F2": 1.48, "F3": 0.9}
    trials = {("time_offset", "rgb"): replace(undo_trial(left=left), fault=ClockShift("rgb", 2e7))}
    assert diagnoses_of(explained, trials)[0].cause == "swapped_frames"
    # Of the orders in which frames may be, the one that was tried is not theirs, which says nothing of another.
    trials["swapped_frames", "rgb"] = undo_trial(left=left)
    assert diagnoses_of(explained, trials)[0].cause == "swapped_frames"


def test_a_clock_that_was_set_within_the_file_is_not_ruled_out_by_a_trial_of_the_whole() -> None:
    """Moved in the whole file, the timestamps that were right are off."""
    fast = Hypothesis("clock_rate", "events", 0.9)
    for code, cause in (("clocks.order.backward_steps", "time_offset"), ("clocks.rate.period", "clock_rate")):
        explained = [
            alarm(1, fast, replace(LATE, magnitude=None), code=code),
            alarm(2, replace(LATE, support=0.8), code="index_maps.rgb.entry"),
        ]
        trials = {IS_LATE: undo_trial(left={"F2": 1.0})}
        assert diagnoses_of(explained, trials)[0].cause == cause


def test_a_fault_of_a_stretch_is_not_ruled_out_by_a_trial_of_the_whole() -> None:
    """Mirrored everywhere, the rest of the events disagrees with the frames."""
    moved = Hypothesis("mirrored", "events", 0.97)
    for rule, cause in (("stretch", "mirrored"), ("other", "hot_pixels")):
        explained = [
            alarm(1, moved, Hypothesis("hot_pixels", "events", 0.5), code="event_stream.rates.hot_pixel"),
            alarm(2, replace(moved, support=0.95), code=f"event_response.orientation.{rule}"),
        ]
        trials = {("mirrored", "events"): undo_trial(left={"F1": 3.0})}
        assert diagnoses_of(explained, trials)[0].cause == cause


@pytest.mark.parametrize(
    ("support", "rows", "code", "cause"),
    [
        (0.6, None, "depth.consistency.tile", "unknown"),
        (0.9, None, "depth.consistency.tile", "spatial_offset"),
        (0.9, (1, 4), "depth.consistency.tile", "unknown"),
        (0.6, None, "metadata.cameras.size", "spatial_offset"),
    ],
)
def test_a_guess_that_undoing_does_not_help_is_no_name(
    support: float, rows: tuple[int, int] | None, code: str, cause: str
) -> None:
    """A check that is certain of a cause means another place than was tried; what was declared cannot be undone."""
    moved = Hypothesis("spatial_offset", "depth", support, 4.0, "px")
    trial = replace(undo_trial(left={"F1": 0.9}), fault=ClockShift("depth", 2e7, rows))
    alarms = [alarm(1, moved, code=code, stream="depth"), alarm(2, Hypothesis("unsorted", "imu", 0.9), stream="imu")]
    assert cause in {d.cause for d in diagnoses_of(alarms, {("spatial_offset", "depth"): trial})}
    # A trial of which the windows show another finding alone says nothing of the cause.
    trial = replace(trial, left={"F2": 0.9})
    assert "spatial_offset" in {d.cause for d in diagnoses_of(alarms, {("spatial_offset", "depth"): trial})}


def test_a_cause_without_a_trial_comes_in_the_place_of_a_guess_that_undoing_does_not_help() -> None:
    """Poses that jump back and forth have noise: taking back one jump leaves all that they disturb."""
    jump, noise = Hypothesis("teleport", "pose", 0.95, 0.01, "m"), Hypothesis("noise_misdeclared", "pose", 0.85)
    alarms = [alarm(1, jump, noise, code="depth.consistency.frame", stream="depth")]
    trial = replace(undo_trial(left={"F1": 1.0}), fault=ClockShift("pose", 2e7, (1, 4)))
    assert diagnoses_of(alarms)[0].cause == "teleport"
    assert [d.cause for d in diagnoses_of(alarms, {("teleport", "pose"): trial})] == ["noise_misdeclared"]
