"""The verdict of a file follows from the outcomes of its checks."""

from dataclasses import replace
from typing import get_args

import pytest

from fedora_qa.judgement.verdict import (
    comparisons_of,
    crossing_streams,
    uncompared_streams,
    verdict_of,
    with_required_coverage,
)
from fedora_qa.record.types import Outcome, Result, Verdict
from fedora_qa.record.wording import SHORT_OF_COVERAGE
from tests.support.all_checks import CHECKS
from tests.support.records import crashed, failed, file_record, passed

CROSSING = frozenset({"a.crossing"})


def results(**outcomes: Outcome) -> tuple[Result, ...]:
    return tuple(Result(f"a.{name}", outcome, "") for name, outcome in outcomes.items())


@pytest.mark.parametrize(
    ("outcomes", "expected"),
    [
        ({"crossing": "passed", "own": "passed"}, "clean"),
        ({"crossing": "warned", "own": "not_applicable"}, "clean"),
        ({"crossing": "passed", "own": "failed"}, "findings"),
        ({"crossing": "failed", "own": "crashed"}, "incomplete"),
        ({"crossing": "not_observable", "own": "passed"}, "incomplete"),
        ({"crossing": "not_applicable", "own": "passed"}, "incomplete"),
        ({"crossing": "not_observable", "own": "failed"}, "findings"),
    ],
)
def test_verdict(outcomes: dict[str, Outcome], expected: Verdict) -> None:
    """A crash takes precedence over findings; without a conclusive comparison of streams a file is not clean."""
    assert verdict_of(results(**outcomes), CROSSING) == expected


@pytest.mark.parametrize("outcome", get_args(Outcome))
def test_no_check_across_streams_was_selected(outcome: Outcome) -> None:
    """Where nothing selected compares streams, no comparison is demanded."""
    expected = {"crashed": "incomplete", "failed": "findings"}.get(outcome, "clean")
    assert verdict_of(results(own=outcome), frozenset()) == expected


def test_crossing_streams() -> None:
    """Flow against frames compares two streams, the orientation of poses none."""
    crossing = crossing_streams({check.name: check.needs for check in CHECKS})
    assert "flow_photometric.residual" in crossing
    assert "pose.orientation" not in crossing


@pytest.mark.parametrize(
    ("selected", "maps", "other", "expected"),
    [
        ({"index_maps.rgb", "a.crossing"}, "passed", "not_observable", "incomplete"),
        ({"index_maps.rgb", "a.crossing"}, "passed", "passed", "clean"),
        ({"index_maps.rgb", "a.crossing"}, "not_applicable", "warned", "clean"),
        ({"index_maps.rgb"}, "passed", "not_observable", "clean"),
        ({"index_maps.rgb"}, "not_observable", "passed", "incomplete"),
    ],
)
def test_an_index_map_alone_is_not_enough(selected: set[str], maps: Outcome, other: Outcome, expected: Verdict) -> None:
    """A map repeats timestamps; it suffices only where nothing else that compares streams was selected."""
    both = (Result("index_maps.rgb", maps, ""), Result("a.crossing", other, ""))
    assert verdict_of(both, frozenset(selected)) == expected


def test_comparisons_are_counted() -> None:
    """Those that came to an outcome count, whatever the verdict."""
    counted = results(first="passed", second="warned", third="failed", fourth="not_observable", own="passed")
    crossing = frozenset({"a.first", "a.second", "a.third", "a.fourth"})
    assert comparisons_of(counted, crossing) == 2


def test_streams_that_nothing_compared_are_named() -> None:
    """An index map compares no stream, a check that came to no outcome neither, and a check of one stream as little."""
    needs = {
        "a.first": ("flow", "depth"),
        "a.second": ("imu", "pose"),
        "a.own": ("rgb",),
        "index_maps.rgb": ("rgb_to_event", "rgb", "events"),
    }
    counted = results(first="passed", second="not_observable", own="passed")
    counted += (Result("index_maps.rgb", "passed", ""),)
    streams = {"flow/10hz", "flow/25hz", "depth", "imu", "pose", "rgb", "events", "rgb_to_event"}
    assert uncompared_streams(counted, needs, streams) == ("events", "imu", "pose", "rgb")
    assert uncompared_streams(counted, needs, {"flow/10hz", "depth"}) == ()


def test_less_coverage_than_required_is_incomplete() -> None:
    """A check meets its own requirement, else that of its subject, else none; one that measured nothing meets none."""
    timing, response = failed(), replace(failed(), check="event_response.model")
    file = file_record(timing, response, passed(), crashed())
    share = 12 / 101
    assert with_required_coverage(file, {}) is file
    assert with_required_coverage(file, {"event_response": share, "clocks": 1.0}) is file
    short = with_required_coverage(file, {"event_response": 0.5, "event_response.model": 0.1, "imu": 0.0})
    assert short.verdict == "incomplete"
    assert short.results == (replace(timing, reason=short.results[0].reason), *file.results[1:])
    assert short.results[0].reason == f"saw 0.119 of its stream {SHORT_OF_COVERAGE} 0.5"
    broken = with_required_coverage(file, {"imu": 1e-3}).results[-1]
    assert broken.reason == f"{crashed().reason}; saw 0 of its stream {SHORT_OF_COVERAGE} 0.001"
