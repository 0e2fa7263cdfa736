"""The tables of a study say what was planted and found, no more."""

import math
from collections.abc import Sequence
from dataclasses import asdict, replace

import pytest
from pydantic import TypeAdapter

from fedora_qa.power.detection import by_cause, curve_of, detections, factor_between, false_alarms
from fedora_qa.power.manifest import PlantedFault
from fedora_qa.power.stated_limits import stated_limits
from fedora_qa.power.study import MeasuredDeviation, NamedCause, Trial, checked_from
from fedora_qa.power.tables import accuracy_by_status, confusions, magnitude_errors, naming, power_of
from fedora_qa.record.power_study import NOT_FOUND, StatedLimit
from fedora_qa.record.types import Coverage, Measurement, Result
from tests.support.records import file_record
from tests.support.studies import CHECK, CLEAN, ORIGIN, clean, faulty, late, measurement, study


def limits_of(trials: tuple[Trial, ...]) -> StatedLimit:
    """The one stated limit of a study with one cause and one check."""
    files = {trial.item.file: trial for trial in trials if trial.item.is_clean}
    (sized,) = by_cause(trials)
    ((stated,), _) = stated_limits(sized, files)
    return stated


def test_limit_is_found_where_it_was_planted() -> None:
    """Of 60 late files, 95% of which are found at 1 ms, the interval of that size holds 1 ms."""
    (sized,) = by_cause(study(limit_ms=1.0))
    whole, check = detections(sized)
    assert (whole.check, check.check, whole.unit) == ("", CHECK, "ms")
    assert whole.found == check.found
    at_95 = whole.curve.at_95
    assert at_95.low is not None
    assert at_95.high is not None
    assert at_95.low < 1.0 < at_95.high
    assert sum(part.found.of for part in whole.tried) == 60
    assert sum(part.found.count for part in whole.tried) == whole.found.count


def test_what_is_found_need_not_fail_a_release() -> None:
    """Of events that are late by 0.01 to 1 ms, all are found, and those late by less than 0.1 ms pass a release."""
    sizes_ms = [0.01 * 1.2**k for k in range(26)]
    trials = [
        faulty(k, PlantedFault("time_offset", "events", size, "ms"), material=size > 0.1)
        for k, size in enumerate(sizes_ms)
    ]
    (sized,) = by_cause(trials)
    whole, check = detections(sized)
    for row in (whole, check):
        assert row.curve.fitted == "all_found"
        assert row.material is not None
        assert row.material_curve is not None
        assert row.material.count == sum(size > 0.1 for size in sizes_ms)
        at_95 = row.material_curve.at_95
        assert at_95.low is not None
        assert at_95.high is not None
        assert at_95.low < 0.13 < at_95.high


@pytest.mark.parametrize(("value", "material"), [(0.05, ()), (0.5, (CHECK,)), (None, (CHECK,))])
def test_a_failed_check_is_material_by_its_measurement(value: float | None, material: tuple[str, ...]) -> None:
    """Beyond its limit by 0.05 ms an offset is immaterial to a release, by 0.5 ms it is not, and no number never is."""
    offset = Measurement("time_offset", value, "ms", 0.001, 0.0, 0.004, 0.006, code="event_response.timing.offset")
    failed = Result(CHECK, "failed", "Are events in time?", (offset,), Coverage(1, 1, "windows"))
    assert checked_from(file_record(failed)).material == material


def test_a_fault_that_grows_as_its_size_falls() -> None:
    """Poses interpolated from 20 Hz are found and from 80 Hz not: the curve falls, with its bounds in order."""
    rates_hz = [10.0, 20.0, 30.0, 45.0, 50.0, 60.0, 80.0, 90.0]
    found = [True, True, True, False, True, False, False, False]
    curve = curve_of(rates_hz, found, worse_when_smaller=True)
    points = [point.probability for point in curve.points]
    assert points == sorted(points, reverse=True)
    assert curve.at_95.value is not None
    assert curve.at_50.value is not None
    assert curve.at_95.value < curve.at_50.value
    assert curve.at_50.low is not None
    assert curve.at_50.high is not None
    assert curve.at_50.low < curve.at_50.value < curve.at_50.high


@pytest.mark.parametrize(
    ("sizes", "found", "why"),
    [
        ([0.0, 0.0], [True, False], "no_size"),
        ([1.0, 2.0], [True, True], "all_found"),
        ([1.0, 2.0], [False, False], "none_found"),
        ([1.0, 2.0, 3.0], [False, True, True], "too_few"),
        ([1.0, 1.0, 1.0, 2.0, 2.0, 2.0], [False, False, True, False, True, True], "too_few"),
        ([1.0, 2.0, 3.0, 4.0, 5.0], [True, True, False, False, False], "not_rising"),
    ],
)
def test_why_there_is_no_curve(sizes: list[float], found: list[bool], why: str) -> None:
    """Where trials say nothing about a curve, the reason is given and every number is unknown."""
    curve = curve_of(sizes, found)
    assert (curve.fitted, curve.at_95.value, curve.points) == (why, None, ())


def test_sizes_in_several_units_are_one_cause() -> None:
    """2000 us is 2 ms; a count of samples is another matter."""
    planted = [PlantedFault("dropped_samples", "events", 2.0, unit) for unit in ("ms", "samples")]
    planted.append(PlantedFault("dropped_samples", "events", 2000.0, "us"))
    groups = by_cause(faulty(k, fault) for k, fault in enumerate(planted))
    assert [(sized.unit, sized.sizes) for sized in groups] == [("ms", (2.0, 2.0)), ("samples", (2.0,))]


def test_faults_of_a_part_have_no_part_in_the_curve() -> None:
    """A fault of half of the time, or one of two, says nothing of the size at which a whole one is found."""
    half = PlantedFault("time_offset", "events", 2.0, "ms", start_s=0.2)
    two = (replace(half, start_s=None), PlantedFault("gyro_bias", "imu", 1.0, "rad/s"))
    assert by_cause([faulty(1, half), faulty(2, *two)]) == ()
    assert [one.kind for one in naming([faulty(1, half), faulty(2, *two)])] == ["local", "composite"]


def test_diagnoses_are_counted_by_status() -> None:
    """Of three confirmed diagnoses two name what was planted, in one stream of it; a clean file has no right one."""
    offset = PlantedFault("time_offset", "events", 2.0, "ms")
    right, of_rgb = (NamedCause(f"{stream}:time_offset", 2.0, "ms", 0.1, "confirmed") for stream in ("events", "rgb"))
    guess = NamedCause("metadata:missing_attribute", None, "", None, "suggested")
    trials = [faulty(1, offset, diagnoses=[right, guess]), faulty(2, offset, diagnoses=[right])]
    wrong = clean("3.h5")
    trials.append(replace(wrong, checked=replace(wrong.checked, diagnoses=(of_rgb,))))
    counts = {(row.status, row.cause): (row.right.count, row.right.of) for row in accuracy_by_status(trials)}
    assert counts == {
        ("confirmed", ""): (2, 3),
        ("confirmed", "time_offset"): (2, 3),
        ("suggested", ""): (0, 1),
        ("suggested", "missing_attribute"): (0, 1),
    }


def test_false_alarms_by_check() -> None:
    """Two of five clean files fail, one check in both and another in one of them; faulty files count nothing."""
    trials = [clean(f"{k}.h5") for k in range(3)]
    trials += [clean("3.h5", failed=("a.b",)), clean("4.h5", failed=("a.b", "c.d")), late(1, 2.0, found=True)]
    alarms = false_alarms(trials, 1e-4)
    assert (alarms.files.count, alarms.files.of) == (2, 5)
    assert {check: share.count for check, share in alarms.by_check.items()} == {"a.b": 2, "c.d": 1}
    assert alarms.chance == pytest.approx(10 * 1e-8, rel=0.01)


def test_matrix_and_shares_of_names() -> None:
    """Of three late files one is named, one named otherwise, one not found."""
    trials = [late(1, 2.0, found=True), late(2, 2.0, found=True, named="rgb:time_offset"), late(3, 0.1, found=False)]
    trials[2] = replace(trials[2], item=replace(trials[2].item, observable=False))
    (row,) = naming(trials)
    assert (row.observable.count, row.observable.of) == (2, 2)
    assert (row.found.count, row.found.of, row.named_first.count, row.named_first.of) == (2, 3, 1, 2)
    named = {(one.planted, one.named): one.count for one in confusions(trials)}
    assert named == {("events:time_offset", name): 1 for name in ("events:time_offset", "rgb:time_offset", NOT_FOUND)}


def test_pulls_and_relative_errors() -> None:
    """Told sizes of 1.9, 2.0 and 2.2 ms with an error of 0.1 ms are -1, 0 and 2 errors off, and 5% in the middle."""
    trials = []
    for k, told in enumerate((1.9, 2.0, 2.2)):
        trial = late(k, 2.0, found=True)
        verdict = replace(trial.checked.diagnoses[0], magnitude=1e3 * told, standard_error=100.0, unit="us")
        trials.append(replace(trial, checked=replace(trial.checked, diagnoses=(verdict,))))
    (one,) = magnitude_errors(trials)
    assert (one.cause, one.unit, one.count, one.with_error) == ("events:time_offset", "ms", 3, 3)
    assert one.median_relative_error == pytest.approx(0.05)
    assert one.pull_median == pytest.approx(0.0, abs=1e-9)
    assert one.pull_spread == pytest.approx(1.4826)
    assert one.within_two.of == 3


@pytest.mark.parametrize(("limit_ms", "truth"), [(1.0, "true"), (4.0, "too_bold"), (0.2, "too_cautious")])
def test_stated_limits_are_judged(limit_ms: float, truth: str) -> None:
    """A check that states 1 ms is right if it finds 95% there, bold if only at 4 ms, cautious if at 0.2 ms."""
    stated = limits_of(study(limit_ms, trials=80))
    assert (stated.check, stated.measurements, stated.median, stated.truth) == (CHECK, ("offset",), 1.0, truth)


def test_each_file_is_held_to_its_own_limit() -> None:
    """Where one clean file states 1 ms and another 10, sizes count in units of each."""
    trials = [clean(), clean("clean/night.h5", stated=(measurement(least=10.0),))]
    for k in range(8):
        trial = late(k, 2.0, found=k % 2 == 0)
        item = trial.item if k % 2 == 0 else replace(trial.item, base="clean/night.h5")
        trials.append(replace(trial, item=item))
    stated = limits_of(tuple(trials))
    assert (stated.least, stated.median, stated.most) == (1.0, 5.5, 10.0)
    assert (stated.found_from_it.count, stated.found_from_it.of, stated.truth) == (4, 4, "true")
    assert (stated.found_from_twice.count, stated.found_from_twice.of) == (4, 4)


def test_what_another_check_finds_counts_for_the_file_alone() -> None:
    """A check that says nothing of a fault that it should see is missing one, though the file does not pass."""
    trials = [clean(), *(late(number, 4.0, found=True) for number in range(4))]
    by_others = replace(trials[-1], checked=replace(trials[-1].checked, failed=("another.check",), measurements=()))
    stated = limits_of((*trials[:-1], by_others))
    by_any = stated.found_from_twice_by_any
    assert (stated.found_from_twice.count, stated.found_from_twice.of) == (3, 4)
    assert by_any is not None
    assert (by_any.count, by_any.of) == (4, 4)


def moved(number: int, effect_px: float, limit_px: float, clean_px: float = 0.0) -> Trial:
    """A late file whose events lie ``effect_px`` further from their frames than those of its clean file."""
    after = replace(measurement(clean_px + effect_px, name="shift", unit="px"), limit=limit_px)
    return faulty(number, PlantedFault("time_offset", "events", 5.0, "ms"), found=after.exceeds, measurements=(after,))


def in_px(trials: Sequence[Trial], clean_px: float = 0.0) -> StatedLimit:
    """What becomes of a stated limit of 1 px, where the clean file deviates as said."""
    return limits_of((clean(stated=(measurement(clean_px, name="shift", unit="px"),)), *trials))


EFFECTS_PX = tuple(0.1 * 1.1**k for k in range(40))


@pytest.mark.parametrize(("limit_px", "truth"), [(0.7, "true"), (1.9, "too_bold"), (0.2, "too_cautious")])
def test_a_fault_in_another_unit_is_compared_by_what_it_moves(limit_px: float, truth: str) -> None:
    """A shift in px cannot measure ms, but what lateness moves it by is held against the 1 px that is stated."""
    stated = in_px([moved(k, effect, limit_px) for k, effect in enumerate(EFFECTS_PX)])
    assert (stated.compared, stated.unit, stated.measurements) == ("response", "px", ("shift",))
    assert (stated.median, stated.truth) == (1.0, truth)


def test_what_the_clean_file_deviates_by_is_not_the_faults_effect() -> None:
    """A clean file 0.6 px off by itself, and 0.5 px more: half the limit is what was planted, not all of it."""
    stated = in_px([moved(k, 0.5, 0.7, clean_px=0.6) for k in range(4)], clean_px=0.6)
    assert (stated.found_from_it.of, stated.curve.fitted, stated.truth) == (0, "all_found", "untested")


def test_a_fault_that_widens_the_limit_counts() -> None:
    """Where the fault itself makes the limit ten times as wide, its misses are misses of the stated limit."""
    trials = [moved(k, effect, 0.7) for k, effect in enumerate(EFFECTS_PX)]
    wide = [moved(100 + k, 3.0, 7.0) for k in range(9)]
    at_first = (replace(measurement(name="shift", unit="px"), limit=0.7),)
    stated = limits_of((clean(stated=at_first), *trials, *wide))
    assert (stated.found_from_it.count, stated.found_from_it.of) == (15, 24)
    assert (stated.worsened, stated.truth) == (9, "too_bold")


@pytest.mark.parametrize(
    ("least_px", "highest_px", "truth"), [(1.0, 1.0, "too_bold"), (1.0, 2.0, "true"), (0.1, 2.0, "true")]
)
def test_a_range_promises_its_highest_limit(least_px: float, highest_px: float, truth: str) -> None:
    """What is detected from 1.9 px on is true of a range up to 2 px, whatever the most sensitive place could detect."""
    stated = replace(measurement(name="shift", unit="px"), least_detectable_range=(least_px, highest_px))
    limits = limits_of((clean(stated=(stated,)), *(moved(k, effect, 1.9) for k, effect in enumerate(EFFECTS_PX))))
    assert (limits.median, limits.truth) == (highest_px, truth)


@pytest.mark.parametrize(("least_px", "truth"), [(0.2, "true"), (1.0, "too_cautious")])
def test_a_range_is_too_cautious_only_by_its_lowest_limit(least_px: float, truth: str) -> None:
    """What is detected from 0.2 px on is no surprise where the most sensitive place detects that."""
    stated = replace(measurement(name="shift", unit="px"), least_detectable_range=(least_px, 1.0))
    limits = limits_of((clean(stated=(stated,)), *(moved(k, effect, 0.2) for k, effect in enumerate(EFFECTS_PX))))
    assert limits.truth == truth


def test_a_range_is_stored_with_its_measurement() -> None:
    """The range of the record is kept, and a result that was stored without one has the single limit."""
    shift = Measurement("shift", 0.1, "px", 0.1, 0.0, 0.6, 0.8, least_detectable_range=(0.75, 4.0))
    passed = Result(CHECK, "passed", "Are events in place?", (shift,), Coverage(1, 1, "windows"))
    (stored,) = checked_from(file_record(passed)).measurements
    assert stored.stated_limits == (0.75, 4.0)
    before = {name: value for name, value in asdict(stored).items() if name != "least_detectable_range"}
    assert TypeAdapter(MeasuredDeviation).validate_python(before).stated_limits == (0.8, 0.8)


def test_far_beyond_its_limit_a_fault_says_nothing_of_it() -> None:
    """Found a thousand times beyond the limit, and never near it: untested."""
    stated = in_px([moved(k, 1000.0, 0.7) for k in range(9)])
    assert (stated.found_from_it.count, stated.truth) == (9, "untested")


@pytest.mark.parametrize(("trials", "reason"), [(2, "exceeded in fewer than 3 trials"), (5, "states a limit")])
def test_what_cannot_be_compared_says_why(trials: int, reason: str) -> None:
    """Too few trials, or clean files that state no limit."""
    (sized,) = by_cause(moved(k, 5.0, 0.7) for k in range(trials))
    true, (other,) = stated_limits(sized, {CLEAN: clean(stated=(measurement(least=None, name="shift", unit="px"),))})
    assert true == ()
    assert reason in other.reason


def test_a_deviation_that_is_not_the_size_is_compared_by_response() -> None:
    """In the fault's unit, and ten times the fault: it does not measure it, but it responds."""
    fault = PlantedFault("time_offset", "events", 0.3, "ms")
    (sized,) = by_cause(faulty(k, fault, measurements=(measurement(3.0),)) for k in range(5))
    ((stated,), _) = stated_limits(sized, {CLEAN: clean()})
    assert (stated.compared, stated.found_from_twice.count, stated.truth) == ("response", 5, "true")


def test_a_shift_in_any_direction_is_compared_by_response() -> None:
    """A shift down by 5 px that moves the image to the right by nothing does not test the limit of that component."""
    files = []
    for number, effect_px in enumerate((5.0, 4.9, 5.1, 5.0, 0.0)):
        across = replace(measurement(effect_px, name="shift_right", unit="px"), limit=0.7)
        fault = PlantedFault("spatial_offset", "rgb", 5.0, "px", direction_deg=0.0 if effect_px else 90.0)
        files.append(faulty(number, fault, found=across.exceeds, measurements=(across,)))
    stated = limits_of((clean(stated=(measurement(name="shift_right", unit="px"),)), *files))
    assert (stated.compared, stated.found_from_it.count, stated.found_from_it.of) == ("response", 4, 4)


def test_a_study_of_clean_files_alone() -> None:
    """Without faults there are false alarms to report, and nothing else."""
    power = power_of([clean()], ORIGIN)
    assert (power.files, power.clean, power.detections, power.naming, power.stated) == (1, 1, (), (), ())


@pytest.mark.parametrize(
    ("unit", "other", "factor"),
    [
        ("ms", "us", 1e3),
        ("deg", "rad", math.pi / 180),
        ("1", "percent", 100.0),
        ("px", "px", 1.0),
        ("px", "m", None),
        ("", "ms", None),
    ],
)
def test_units_that_stand_for_each_other(unit: str, other: str, factor: float | None) -> None:
    """Units of one dimension have a factor, others none."""
    assert factor_between(unit, other) == (None if factor is None else pytest.approx(factor))


def test_copies_of_a_false_alarm_are_set_aside() -> None:
    """What fails in a copy of a clean file that fails says nothing of the fault."""
    power = power_of([clean(failed=("a.b",)), late(1, 2.0, found=True)], ORIGIN)
    assert (power.set_aside, power.false_alarms.files.count) == (1, 1)
    assert (power.detections, power.naming, power.confusions, power.magnitudes) == ((), (), (), ())


@pytest.mark.parametrize(("missed", "truth"), [(0, "true"), (1, "untested"), (2, "too_bold")])
def test_one_miss_of_six_can_be_chance(missed: int, truth: str) -> None:
    """Of six faults beyond the limit, one missed says nothing against 95%; two would come with a chance of 3%."""
    trials = tuple(late(k, 2.0, found=k >= missed) for k in range(6))
    assert limits_of((clean(), *trials)).truth == truth
