"""Causes that the balance of events against changes of the light measures."""

from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
import pytest

from fedora_qa.checks.event_response.conservation import ViolationCluster, Violations
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.event_balance import (
    hypotheses_of_balance,
    is_reversed_for_a_while,
    without_balance_of_wrong_frames,
)
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.events.balance_estimates import GainEstimate
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.views.event_balance import BalanceCourse, EventBalance, EventsAgainstChange
from tests.checks.event_file import SMOOTH_WORLD, log_file
from tests.estimators.event_world import Stream

LOG: Final = EventModel("log", 0.2, 0.2)

USUAL: Final = GainEstimate(0.97, 0.01)
CLUSTER: Final = ViolationCluster(44.7, 0.2, 0.1, 0.0, 0.05)


def balance(
    gain: float = 0.97,
    *,
    growth: float = 1.0,
    scatter: float = 0.02,
    scatter_error: float = 0.03,
    spread: float = 0.0,
    silent: float = 0.0,
) -> EventBalance:
    of_all = GainEstimate(gain, 0.01)
    return EventBalance(
        of_all,
        GainEstimate(growth, 0.05),
        GainEstimate(scatter, scatter_error),
        GainEstimate(spread, 0.005),
        silent,
    )


def course(
    over: Literal["part", "time", "image"], contrast: float, scatter: float = 0.0, error: float = 0.03
) -> BalanceCourse:
    return BalanceCourse(over, GainEstimate(contrast, 0.02), 0.97, GainEstimate(scatter, error))


def named(*features: Feature, model: EventModel = LOG) -> list[str]:
    return [hypothesis.cause for hypothesis in hypotheses_of_balance((CLUSTER, *features), model)]


@pytest.mark.parametrize(
    ("features", "cause"),
    [
        ((balance(),), None),
        # Fewer events: by the scatter of what is left, other thresholds or a loss; neither where the scatter decides
        # nothing.
        ((balance(0.6), course("time", -0.4)), "threshold_misdeclared"),
        ((balance(0.6, scatter=0.4),), "dropped_samples"),
        ((balance(0.6, scatter=0.2), course("time", -0.4, scatter=0.2)), None),
        ((balance(0.6, scatter=0.4, scatter_error=0.5),), None),
        # More events, which scatter no more.
        ((balance(1.5), course("time", 0.4)), "threshold_misdeclared"),
        ((balance(1.5, scatter=0.5), course("time", 0.4)), None),
        # Pixels that give one event at most for some time.
        ((balance(0.5, growth=0.2, scatter=-0.1),), "dropped_samples"),
        # Where the gain differs.
        ((balance(0.9), course("part", -0.5)), "threshold_misdeclared"),
        ((balance(0.9), course("part", -0.5, scatter=0.5)), "dropped_samples"),
        ((balance(0.9), course("part", -0.5, error=0.6)), None),
        ((balance(0.9), course("part", -1.9)), "polarity_inverted"),
        ((balance(0.7), course("time", -0.5)), "threshold_misdeclared"),
        ((balance(0.7), course("image", 0.6)), "threshold_misdeclared"),
        ((balance(0.97), course("image", 0.2)), None),
        # The same pixels give too many, or too few, all the time.
        ((balance(spread=0.1, scatter=0.4),), "threshold_misdeclared"),
        ((balance(0.6, spread=0.2, scatter=0.9),), None),
        # Tiles without any event hold what is missing.
        ((balance(0.6, silent=0.8),), None),
        # Events against the light.
        ((balance(), EventsAgainstChange(200, 1.0, 0.0)), "noise_misdeclared"),
        ((balance(), EventsAgainstChange(200, 1.0, 0.9)), "hot_pixels"),
        ((balance(), EventsAgainstChange(200, 0.01, 0.0)), None),
        ((balance(), EventsAgainstChange(3, 1.0, 0.0)), None),
        # Of a part of the time that does not follow the light they are no noise.
        ((balance(0.9), course("part", -0.5, error=0.6), EventsAgainstChange(200, 1.0, 0.0)), None),
    ],
)
def test_gain_and_scatter_name_the_cause(features: tuple[Feature, ...], cause: str | None) -> None:
    assert named(*features) == ([] if cause is None else [cause])


def test_a_part_states_the_size_of_its_thresholds() -> None:
    """Half of the events: declared half of the true threshold. A fault of more than half of the time is the rest."""
    (short,) = hypotheses_of_balance((CLUSTER, balance(0.9), course("part", -0.485)), LOG)
    assert (short.magnitude or 0.0) == pytest.approx(-50.0)
    assert short.unit == "percent"
    rest = BalanceCourse("part", GainEstimate(0.5, 0.02), 0.5, GainEstimate(0.0, 0.03))
    (long,) = hypotheses_of_balance((CLUSTER, balance(0.6), rest), LOG)
    assert long.magnitude == pytest.approx(-50.0)


def test_a_gain_of_the_whole_file_is_left_to_the_check_of_thresholds() -> None:
    """A curve of the frames has the same gain, which other checks measure."""
    assert named(balance(0.6)) == []


def test_declared_noise_is_no_fault() -> None:
    """Of which half comes against the light."""
    against = EventsAgainstChange(200, 1.0, 0.0)
    assert named(balance(), against, model=replace(LOG, shot_rate_hz=2.0)) == []


def test_the_linear_model_gives_fewer_events_of_fast_changes() -> None:
    assert named(balance(0.8, scatter=0.2), model=EventModel("linear", 15.0, 15.0)) == []
    assert named(balance(0.8, scatter=0.2)) == ["dropped_samples"]


@pytest.mark.parametrize(("contrast", "is_reversed"), [(-1.9, True), (-0.9, False)])
def test_events_of_the_opposite_sign_for_a_while_are_reversed(contrast: float, *, is_reversed: bool) -> None:
    assert is_reversed_for_a_while([Violations(9, 0.1), course("part", contrast)]) is is_reversed


def thinned(events: Stream) -> Stream:
    kept = np.random.default_rng(0).random(len(events.x)) < 0.6
    return Stream(*(getattr(events, name)[kept] for name in ("x", "y", "times_ns", "p")))


def test_the_check_measures_the_scatter_of_what_is_left(tmp_path: Path) -> None:
    """Of a closed-form world of which 40% of the events are lost, by conservation alone."""
    clean = log_file(SMOOTH_WORLD)
    path = clean.altered(events=thinned(clean.events)).write(tmp_path / "thinned.h5")
    first = check_file(path, CheckOptions(evidence=None, select=("event_response.conservation",))).record.diagnoses[0]
    assert (first.stream, first.cause) == ("events", "dropped_samples")


@pytest.mark.parametrize(
    ("code", "is_left"),
    [
        ("images.order.share", False),
        ("images.repeats.identical", False),
        ("images.exposure.jump", False),
        # A gain after rounding changes no logarithm; flow may be wrong itself.
        ("images.exposure.codes", True),
        ("flow_photometric.residual.field", True),
    ],
)
def test_the_balance_against_wrong_frames_states_nothing_of_the_events(code: str, *, is_left: bool) -> None:
    features = (CLUSTER, balance(0.6), course("part", -0.5), EventsAgainstChange(200, 1.0, 0.0))
    alarms = [
        Alarm(Finding(finding, of, "error", "off", Where()), Statistic("value", 1.0, "1", 0.0, "off", of, Where(),
                                                                       features=features))
        for finding, of in (("F1", "event_response.conservation.pixels"), ("F2", code))
    ]  # fmt: skip
    for alarm in without_balance_of_wrong_frames(alarms):
        assert alarm.statistic.features == (features if is_left else (CLUSTER,))
