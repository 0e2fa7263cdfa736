"""Hypotheses for pixels that fire without cause: hot pixels, or declared ones that a move of all events displaced."""

from typing import Literal, get_args, get_type_hints

import pytest

from fedora_qa.checks.event_stream.duplicates import RepeatedEvents
from fedora_qa.checks.event_stream.rates import HotPixelCount, MovedHotPixels
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from tests.support.proposals import proposed

Move = Literal["mirrored", "transposed", "shifted"]

MOVES: dict[Move, tuple[MovedHotPixels, Hypothesis]] = {
    "mirrored": (MovedHotPixels("mirrored"), Hypothesis("mirrored", "events", 0.97)),
    "transposed": (MovedHotPixels("transposed"), Hypothesis("axes_swapped", "events", 0.97)),
    "shifted": (MovedHotPixels("shifted", 3.0), Hypothesis("spatial_offset", "events", 0.97, 3.0, "px")),
}


@pytest.mark.parametrize("move", get_args(get_type_hints(MovedHotPixels)["transform"]))
def test_a_move_of_the_declared_hot_pixels_is_one_of_all_events(move: Move) -> None:
    """Its fault comes first, with the size of a shift; new hot pixels, or a wrong declaration, are less likely."""
    feature, cause = MOVES[move]
    new = proposed("event_stream.rates.hot_pixel", feature, HotPixelCount(2), stream="events")
    assert new == (cause, Hypothesis("hot_pixels", "events", 0.3, 2.0, "pixels"))
    declared = proposed("event_stream.rates.declared_hot_pixels", feature, stream="events", value=50.0, expected=100.0)
    assert declared == (cause, Hypothesis("noise_misdeclared", "events", 0.3, -50.0, "percent"))


def test_a_shift_along_the_columns_as_well_has_no_size() -> None:
    shifted = proposed("event_stream.rates.hot_pixel", MovedHotPixels("shifted"), HotPixelCount(1), stream="events")[0]
    assert shifted == Hypothesis("spatial_offset", "events", 0.97, None, "px")


def test_without_a_move_pixels_are_hot_or_fire_at_another_rate() -> None:
    assert proposed("event_stream.rates.hot_pixel", HotPixelCount(2), stream="events") == (
        Hypothesis("hot_pixels", "events", 0.95, 2.0, "pixels"),
    )
    assert proposed("event_stream.rates.declared_hot_pixels", stream="events", value=150.0, expected=100.0) == (
        Hypothesis("noise_misdeclared", "events", 0.8, 50.0, "percent"),
    )


def test_what_silences_declared_hot_pixels_may_be_any_fault_of_the_events() -> None:
    """Events that are lost or moved are those of hot pixels as well; none makes them fire more often."""
    slow = proposed("event_stream.rates.declared_hot_pixels", stream="events", value=13.0, expected=200.0)
    assert [(each.cause, each.support) for each in slow] == [("noise_misdeclared", 0.8), (ANY_CAUSE, 0.5)]


@pytest.mark.parametrize(("at_crowds", "cause"), [(900, "quantised_time"), (100, "duplicated_samples")])
def test_repeats_beside_many_others_of_their_timestamp_were_stamped_together(at_crowds: int, cause: str) -> None:
    """Whoever writes events twice crowds no pixels into a timestamp that fire once."""
    repeated = proposed("event_stream.duplicates.event", RepeatedEvents(1000, at_crowds), stream="events")
    assert max(repeated, key=lambda each: each.support).cause == cause
