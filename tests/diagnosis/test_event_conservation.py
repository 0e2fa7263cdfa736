"""Faults that are named because undoing them lets events add up again, in a closed-form world."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.checks.event_response.conservation import (
    ChangeCourses,
    LoneEventRate,
    ViolationCluster,
    Violations,
)
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Diagnosis
from fedora_qa.views.event_balance import EventsAgainstChange
from tests.checks.event_file import SHAPE, SMOOTH_WORLD, EventFile, log_file
from tests.estimators.event_world import MS, Stream
from tests.support.proposals import proposed

OTHER_WORLD = replace(SMOOTH_WORLD, seed=17)

Fault = Callable[[Stream], Stream]


def diagnosed(file: EventFile, path: Path) -> tuple[Diagnosis, ...]:
    """What the check of conservation says alone."""
    options = CheckOptions(evidence=None, select=("event_response.conservation",))
    return check_file(file.write(path), options).record.diagnoses


def kept(events: Stream, rows: NDArray[np.bool_]) -> Stream:
    """The events of these rows."""
    return Stream(*(getattr(events, name)[rows] for name in ("x", "y", "times_ns", "p")))


def inverted_for_a_while(events: Stream) -> Stream:
    inside = (events.times_ns >= 250 * MS) & (events.times_ns < 550 * MS)
    return replace(events, p=np.where(inside, 1 - events.p, events.p).astype(np.uint8))


def inverted_in_the_middle(events: Stream) -> Stream:
    across, down = abs(events.x / SHAPE[1] - 0.5) < 0.25, abs(events.y / SHAPE[0] - 0.5) < 0.25
    return replace(events, p=np.where(across & down, 1 - events.p, events.p).astype(np.uint8))


def mirrored(events: Stream) -> Stream:
    return replace(events, x=(SHAPE[1] - 1 - events.x).astype(np.uint16))


def moved_right(events: Stream) -> Stream:
    inside = kept(events, events.x < SHAPE[1] - 5)
    return replace(inside, x=(inside.x + 5).astype(np.uint16))


def late(events: Stream) -> Stream:
    return replace(events, times_ns=events.times_ns + 12 * MS)


@pytest.mark.parametrize(
    ("fault", "cause", "magnitude"),
    [
        (inverted_for_a_while, "polarity_inverted", None),
        (inverted_in_the_middle, "polarity_inverted", None),
        (mirrored, "mirrored", None),
        (moved_right, "spatial_offset", 5.0),
        (late, "time_offset", 12.0),
    ],
)
def test_what_mends_is_named(fault: Fault, cause: str, magnitude: float | None, tmp_path: Path) -> None:
    """A fault of all events, of a stretch or of a region is named by conservation alone, with its size."""
    clean = log_file(SMOOTH_WORLD)
    first = diagnosed(clean.altered(events=fault(clean.events)), tmp_path / "faulty.h5")[0]
    assert (first.stream, first.cause, first.magnitude) == ("events", cause, magnitude)


def test_no_event_beside_colour_that_changes_is_a_missing_stream(tmp_path: Path) -> None:
    """All events are lost, which is what a file without colour is told."""
    clean = log_file(SMOOTH_WORLD)
    none = kept(clean.events, np.zeros(len(clean.events.x), np.bool_))
    first = diagnosed(clean.altered(events=none), tmp_path / "faulty.h5")[0]
    assert (first.stream, first.cause) == ("events", "missing_stream")


def without_columns(events: Stream) -> Stream:
    return kept(events, (events.x < 40) | (events.x >= 42))


def without_a_block_for_a_while(events: Stream) -> Stream:
    in_block = (abs(events.x - 30) < 8) & (abs(events.y - 20) < 8)
    return kept(events, ~(in_block & (events.times_ns >= 300 * MS) & (events.times_ns < 450 * MS)))


def without_corners(events: Stream) -> Stream:
    down, right = (events.y - (SHAPE[0] - 1) / 2) / SHAPE[0], (events.x - (SHAPE[1] - 1) / 2) / SHAPE[1]
    return kept(events, np.hypot(down, right) < 0.5)


def without_every_fifth_row(events: Stream) -> Stream:
    return kept(events, events.y % 5 != 2)


def without_single_pixels(events: Stream) -> Stream:
    dead = np.random.default_rng(0).random(SHAPE) < 0.02
    return kept(events, ~dead[events.y, events.x])


@pytest.mark.parametrize(
    "fault",
    [without_columns, without_a_block_for_a_while, without_corners, without_every_fifth_row, without_single_pixels],
)
def test_a_region_that_is_silent_is_dead(fault: Fault, tmp_path: Path) -> None:
    """Two dead columns, and a block that is dead for some time, are regions and no lost packets; so are dead pixels of
    any arrangement."""
    clean = log_file(SMOOTH_WORLD)
    first = diagnosed(clean.altered(events=fault(clean.events)), tmp_path / "dead.h5")[0]
    assert (first.stream, first.cause) == ("events", "dead_region")


def test_events_of_another_time_leave_no_dead_pixels(tmp_path: Path) -> None:
    """No pixel has an event between the frames, as all come 37 s later."""
    clean = log_file(SMOOTH_WORLD)
    later = replace(clean.events, times_ns=clean.events.times_ns + 37_000 * MS)
    causes = [found.cause for found in diagnosed(clean.altered(events=later), tmp_path / "later.h5")]
    assert "dead_region" not in causes


def test_what_nothing_mends_is_of_another_sequence(tmp_path: Path) -> None:
    """Events of another world are not taken for events of this one that were moved, turned or delayed."""
    file = log_file(SMOOTH_WORLD).altered(events=log_file(OTHER_WORLD).events)
    assert diagnosed(file, tmp_path / "other.h5")[0].cause == "other_sequence"


@pytest.mark.parametrize(
    ("rate", "is_noise"),
    [
        (LoneEventRate(3.0, 3.4, 1.0), True),
        # Three quarters of the lone events lie in a part of the image.
        (LoneEventRate(0.8, 3.4, 1.0), False),
        # As many would violate the law in 1 - exp(-0.1) of the pixels.
        (LoneEventRate(0.1, 0.1, 1.0), False),
    ],
)
def test_lone_events_everywhere_are_noise(rate: LoneEventRate, is_noise: bool) -> None:
    """A fifth of the pixels that do not add up is what three undeclared events a second explain."""
    features = Violations(2000, 0.2), ViolationCluster(44.7, 0.2, 0.1, 0.0, 0.05), rate
    first = proposed("event_response.conservation.pixels", *features, stream="events")[0]
    assert (first == Hypothesis("noise_misdeclared", "events", 0.9)) is is_noise


@pytest.mark.parametrize(("of_worst_tile", "is_noise"), [(0.9, True), (0.95, False)])
def test_noise_disturbs_no_tile_as_a_whole(of_worst_tile: float, is_noise: bool) -> None:
    """Half an event a second disturbs 0.63 of the pixels in 2 s, and 0.93 of those of the worst tile."""
    cluster = ViolationCluster(44.7, 0.2, 0.1, 0.0, 0.05, fraction_of_worst_tile=of_worst_tile)
    features = Violations(2000, 0.2), cluster, LoneEventRate(0.5, 0.5, 1.0)
    causes = {h.cause for h in proposed("event_response.conservation.pixels", *features, stream="events")}
    assert ("noise_misdeclared" in causes) is is_noise


@pytest.mark.parametrize(
    ("courses", "first"),
    [
        (ChangeCourses(unrelated_percent=14.0), Hypothesis("other_sequence", "events", 0.9, 14.0, "percent")),
        (ChangeCourses(common_percent=17.0), Hypothesis("exposure_or_gamma", "rgb", 0.9, 17.0, "percent")),
        (ChangeCourses(common_percent=1.0), Hypothesis("dropped_samples", "events", 0.4, 2000.0, "samples")),
        (ChangeCourses(), Hypothesis("dropped_samples", "events", 0.4, 2000.0, "samples")),
    ],
)
def test_courses_over_time_are_named_before_losses(courses: ChangeCourses, first: Hypothesis) -> None:
    """What loses events leaves neither unrelated events nor a change of all tiles alike."""
    assert best_supported(courses) == first


def test_tiles_that_are_silent_for_a_while_are_dead() -> None:
    """Where most of the violations lie in them; a readout that saturates loses events elsewhere as well."""
    assert best_supported(ChangeCourses(silent_share=0.7)).cause == "dead_region"
    assert best_supported(ChangeCourses(silent_share=0.3)).cause == "dropped_samples"


def best_supported(courses: ChangeCourses) -> Hypothesis:
    features = Violations(2000, 0.2), ViolationCluster(44.7, 0.2, 0.1, 0.0, 0.05), courses
    hypotheses = proposed("event_response.conservation.pixels", *features, stream="events")
    return max(hypotheses, key=lambda hypothesis: hypothesis.support)


def test_lost_events_are_not_mended(tmp_path: Path) -> None:
    """Events that were lost stay lost: no repair brings them back."""
    clean = log_file(SMOOTH_WORLD)
    packet = (clean.events.times_ns > 300 * MS) & (clean.events.times_ns < 302 * MS)
    lost = packet & (np.arange(len(packet)) % 40 == 0)
    faulty = clean.altered(events=kept(clean.events, ~lost))
    assert diagnosed(faulty, tmp_path / "lost.h5")[0].cause == "dropped_samples"


@pytest.mark.parametrize(
    ("without_events", "firing_of_disturbed", "is_dead"),
    [
        (0.97, np.inf, True),
        # Pixels that fire contradict the frames as well, and no noise is declared.
        (0.87, np.inf, False),
        # Declared noise disturbs so few of those that fire.
        (0.87, 0.01, True),
        # They are as many as all that it can disturb.
        (0.87, 0.9, False),
        (0.4, 0.01, False),
    ],
)
def test_declared_noise_does_not_hide_dead_pixels(
    without_events: float, firing_of_disturbed: float, *, is_dead: bool
) -> None:
    """Dead pixels of any shape never fire; a spurious event disturbs one that does."""
    cluster = ViolationCluster(12.0, 0.01, 0.1, without_events, 0.05, firing_of_disturbed=firing_of_disturbed)
    features = Violations(146, 0.01), cluster
    hypotheses = proposed("event_response.conservation.region", *features, stream="events")
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (best.cause == "dead_region") is is_dead


@pytest.mark.parametrize(("changes_in_box", "is_dead"), [(0.05, True), (0.33, False)])
def test_violations_where_few_events_are_lie_in_a_dead_region(changes_in_box: float, *, is_dead: bool) -> None:
    """Events that are lost anywhere are lost where events are."""
    cluster = ViolationCluster(10.0, 0.01, 0.65, 0.0, 0.33, changes_in_box=changes_in_box)
    features = Violations(100, 0.01), cluster
    hypotheses = proposed("event_response.conservation.region", *features, stream="events")
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert best.cause == ("dead_region" if is_dead else "dropped_samples")


@pytest.mark.parametrize(("against", "is_dead"), [(0, True), (200, False)])
def test_a_region_with_events_against_the_light_is_not_dead(against: int, *, is_dead: bool) -> None:
    """Lost events leave none against the light; events in excess, of a noisy region, come against it as often."""
    cluster = ViolationCluster(10.0, 0.01, 0.65, 0.0, 0.7)
    spurious = EventsAgainstChange(against, against / 200, 0.0)
    features = Violations(100, 0.01), cluster, LoneEventRate(0.0, 0.0, 1.0), spurious
    hypotheses = proposed("event_response.conservation.region", *features, stream="events")
    best = max(hypotheses, key=lambda hypothesis: hypothesis.support)
    assert (best.cause == "dead_region") is is_dead
