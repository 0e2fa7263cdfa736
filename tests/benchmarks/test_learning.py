"""The study of learning without its networks: voxel grids, splits, bookkeeping, faults, scores, statistics, page."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_ind

from fedora_qa.causes import CAUSES
from fedora_qa.geometry import so3
from fedora_qa.judgement.materiality import materiality_row
from fedora_qa.scoring.fault_prices import read_fault_prices, write_fault_prices
from tests.benchmarks.learning.budget import BINS, BUDGETS, COLOUR_SIZE, EVENT_SIZE, FLIGHT_S
from tests.benchmarks.learning.flights import MOTION_KINDS, REGIONS_M, SPLITS, FlightDraw, draws_of
from tests.benchmarks.learning.page import fault_prices, page
from tests.benchmarks.learning.planted import (
    PACKET_US,
    PLANTED,
    PlantedFault,
    add_pose_noise,
    drop_packets,
    faulty_samples,
)
from tests.benchmarks.learning.price import (
    METRICS,
    Cost,
    costs_of,
    least_costly_size,
    material_size,
    mean_interval,
)
from tests.benchmarks.learning.results import Results, trivial_name
from tests.benchmarks.learning.runs import PARTS, RATES_HZ, Arrangement, TrainingRun, arrangements_of, runs_of
from tests.benchmarks.learning.samples import Targets, chained, motions, read_samples
from tests.benchmarks.learning.scores import Errors, enlarged, errors_of, trivial_predictions
from tests.benchmarks.learning.voxels import voxel_grid
from tests.support.all_checks import CHECKS
from tests.support.shared_files import SharedFiles

DRAW = FlightDraw("flying", "validation", 0)
RATE_HZ = RATES_HZ[0]


@pytest.fixture
def flight(shared_files: SharedFiles) -> Path:
    """One flight of the study."""
    return shared_files.file(f"learning-{DRAW.name}.h5", DRAW.write)


def test_a_voxel_grid_is_bilinear_in_time() -> None:
    """An event gives its sign to the two bins around it, in proportion to how near they are."""
    events = np.array([[3, 1, 100, 1], [0, 0, 130, 0], [3, 1, 200, 1]])
    grid = voxel_grid(events, 100, 200, bins=5, size=(4, 2))
    expected = np.zeros((5, 2, 4), np.float32)
    expected[0, 1, 3] = expected[4, 1, 3] = 1
    # 30% of the interval are 1.2 of the four steps between five bins.
    expected[1, 0, 0], expected[2, 0, 0] = -0.8, -0.2
    np.testing.assert_allclose(grid, expected, atol=1e-6)


def test_a_voxel_grid_sums_to_the_polarities() -> None:
    """Whatever lies within the interval counts once, pixel by pixel."""
    rng = np.random.default_rng(1)
    events = np.stack([rng.integers(bound, size=500) for bound in (8, 6, 1001, 2)], axis=1)
    grid = voxel_grid(events, 0, 1000, bins=7, size=(8, 6))
    signs = np.zeros((6, 8))
    np.add.at(signs, (events[:, 1], events[:, 0]), 2 * events[:, 3] - 1)
    np.testing.assert_allclose(grid.sum(axis=0), signs, atol=1e-4)


def test_an_event_beyond_the_interval_counts_as_far_as_the_outer_bins_reach() -> None:
    """Half a bin early it gives a half to the first, two bins late nothing."""
    events = np.array([[0, 0, -125, 1], [1, 0, 1500, 1]])
    grid = voxel_grid(events, 0, 1000, bins=5, size=(2, 1))
    assert grid[0, 0, 0] == pytest.approx(0.5)
    assert grid.sum() == pytest.approx(0.5)


@pytest.mark.parametrize("kind", MOTION_KINDS)
def test_test_flights_are_over_ground_of_their_own(kind: str) -> None:
    """Flights differ, are the same when drawn again, and stay within the region of their split."""
    starts = set()
    for split in SPLITS:
        low_m, high_m = REGIONS_M[split]
        for draw in draws_of(kind, split, 2):  # type: ignore[arg-type]
            states = draw.scene().fly().states_at(np.linspace(0, FLIGHT_S, 21))
            assert (low_m <= states.positions_world_m[:, 0]).all()
            assert (states.positions_world_m[:, 0] <= high_m).all()
            again = draw.scene().fly().states_at(np.linspace(0, FLIGHT_S, 21))
            np.testing.assert_array_equal(again.positions_world_m, states.positions_world_m)
            starts.add(tuple(states.positions_world_m[0]))
    assert len(starts) == 6
    assert REGIONS_M["test"][0] > max(REGIONS_M[split][1] for split in ("train", "validation"))


def test_a_drive_has_three_degrees_of_freedom() -> None:
    """Height, pitch and roll are constant, the speed is that of a car, and the nose points along the path."""
    for draw in draws_of("driving", "train", 4):
        states = draw.scene().fly().states_at(np.linspace(0, FLIGHT_S, 21))
        assert np.ptp(states.positions_world_m[:, 2]) == 0
        np.testing.assert_allclose(states.R_world_body[:, 2, 2], 1, atol=1e-12)
        speeds_m_s = np.linalg.norm(states.velocities_world_m_s, axis=1)
        assert (speeds_m_s > 5.9).all()
        assert (speeds_m_s < 14.2).all()
        along_path = np.einsum("ni,ni->n", states.R_world_body[:, :, 0], states.velocities_world_m_s) / speeds_m_s
        assert np.degrees(np.arccos(np.minimum(along_path, 1))).max() < 0.3


def test_both_kinds_have_one_world_light_and_sensor() -> None:
    """Only the motion differs; thresholds change where a fault asks for it."""
    flying, driving = (draws_of(kind, "train", 2)[1].scene() for kind in MOTION_KINDS)
    assert flying.world == driving.world
    assert flying.light == driving.light
    assert flying.events == driving.events
    assert flying.camera == driving.camera
    larger = replace(draws_of("flying", "train", 2)[1], threshold_gain=1.1).scene()
    assert larger.events.threshold_on == pytest.approx(1.1 * flying.events.threshold_on)
    assert larger.flight == flying.flight


def test_iso_sample_has_as_many_intervals_as_the_lowest_rate() -> None:
    """Iso-time has all: 10, 25 and 50 in a second; iso-sample 10 of each flight, in less time."""
    by_sampling: dict[str, list[float]] = {"iso-time": [], "iso-sample": []}
    for arrangement in arrangements_of("a"):
        intervals = arrangement.rate_hz * FLIGHT_S
        by_sampling[arrangement.sampling].append(min(intervals, arrangement.most or intervals))
    assert by_sampling == {"iso-time": [10, 25, 50], "iso-sample": [10, 10]}


def test_names_of_runs_are_unique_and_parts_share_runs() -> None:
    """No two runs write one result; the flying networks on correct data are trained once for all parts."""
    budget = BUDGETS["small"]
    runs = {part: [run for group in runs_of(part, budget) for run in group] for part in PARTS}
    every = {run for of_part in runs.values() for run in of_part}
    assert len({run.name for run in every}) == len(every)
    assert len(runs["a"]) == 5 * budget.seeds
    assert runs["b"] == runs["c"]
    assert len(runs["price"]) == budget.control_seeds + len(PLANTED) * budget.seeds
    shared = {TrainingRun(Arrangement("flying"), seed) for seed in range(budget.seeds)}
    assert all(shared <= set(of_part) for of_part in runs.values())


def test_motions_lead_back_to_the_poses() -> None:
    """Chained from the first pose, the motions between poses give the poses, up to the sign of quaternions."""
    rng = np.random.default_rng(2)
    positions = rng.normal(size=(6, 3))
    orientations = so3.exp_quaternion(rng.normal(size=(6, 3)))
    motion = motions(positions, orientations, np.arange(5), np.arange(1, 6))
    back, back_xyzw = chained(positions[0], orientations[0], motion)
    np.testing.assert_allclose(back, positions, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(back_xyzw * orientations, axis=1)), 1, atol=1e-12)


def test_the_truth_scores_without_error(flight: Path, tmp_path: Path) -> None:
    """True targets at the event camera's pixels, enlarged, err by the interpolation alone; poses not at all."""
    samples = read_samples(flight, RATE_HZ)
    assert samples.voxels.shape == (10, BINS, *EVENT_SIZE[::-1])
    assert np.count_nonzero(samples.voxels[1:]) > 1000
    valid = Targets(
        np.nan_to_num(samples.targets.flow_px),
        np.nan_to_num(samples.targets.disparity_per_m, nan=1e-3),
        samples.targets.motion,
    )
    errors = errors_of([valid], [flight], RATE_HZ, tmp_path)
    assert errors.naee < 0.1
    assert errors.nade < 0.15
    assert errors.nae_position < 1e-4
    assert errors.nae_orientation < 1e-3
    zero = trivial_predictions(samples.targets, 10)["zero"]
    errors = errors_of([zero], [flight], RATE_HZ, tmp_path)
    assert errors.naee == pytest.approx(1)
    assert errors.nae_position == pytest.approx(1)
    assert errors.aee_px == pytest.approx(errors.mean_flow_px)


def test_trivial_predictions_are_means_of_the_training_set() -> None:
    """One vector, or one of each pixel; where no pixel is valid the mean of all stands."""
    flow = np.zeros((2, 2, 1, 3), np.float32)
    flow[:, 0] = [[[1, 2, np.nan]], [[3, 4, np.nan]]]
    targets = Targets(flow, np.array([[[0.1, 0.3, np.nan]]] * 2, np.float32), np.ones((2, 6), np.float32))
    predicted = trivial_predictions(targets, 4)
    np.testing.assert_allclose(predicted["constant"].flow_px[:, 0], 2.5)
    np.testing.assert_allclose(predicted["mean field"].flow_px[3, 0], [[2, 3, 2.5]])
    np.testing.assert_allclose(predicted["mean field"].disparity_per_m[0], [[0.1, 0.3, 0.2]])
    np.testing.assert_allclose(predicted["zero"].motion, 0)


def test_images_are_enlarged_about_the_same_view() -> None:
    """A plane stays the plane: x of the event camera is that of the colour camera, scaled about the pixels' borders."""
    columns = np.broadcast_to(np.arange(EVENT_SIZE[0], dtype=np.float32), EVENT_SIZE[::-1])
    wide = enlarged(np.ascontiguousarray(columns))
    assert wide.shape == COLOUR_SIZE[::-1]
    expected = (np.arange(COLOUR_SIZE[0]) + 0.5) * EVENT_SIZE[0] / COLOUR_SIZE[0] - 0.5
    np.testing.assert_allclose(wide[0, 2:-2], expected[2:-2], atol=1e-3)


def fault_of(cause: str, size: float | None) -> PlantedFault:
    (fault,) = (each for each in PLANTED if (each.cause, each.size) == (cause, size))
    return fault


def test_faults_change_what_they_befall(flight: Path, tmp_path: Path) -> None:
    """Flow grows by its gain; late events, maps and polarities change voxels and no target, ray length disparity."""
    (tmp_path / f"{DRAW.name}.h5").symlink_to(flight)
    correct = read_samples(flight, RATE_HZ)

    def faulty(cause: str, size: float | None) -> tuple[np.ndarray, Targets]:
        samples = faulty_samples(fault_of(cause, size), [DRAW], tmp_path, RATE_HZ)
        return samples.voxels, samples.targets

    voxels, targets = faulty("flow:flow_gain", 10)
    np.testing.assert_array_equal(voxels, correct.voxels)
    np.testing.assert_allclose(targets.flow_px, 1.1 * correct.targets.flow_px, rtol=1e-5)
    for cause, size in (("events:time_offset", 10), ("depth_to_event:index_off_by_one", 10)):
        voxels, targets = faulty(cause, size)
        assert not np.array_equal(voxels, correct.voxels)
        np.testing.assert_array_equal(targets.flow_px, correct.targets.flow_px)
    voxels, _ = faulty("events:polarity_inverted", None)
    np.testing.assert_allclose(voxels, -correct.voxels, atol=1e-5)
    voxels, targets = faulty("depth:depth_ray_not_z", None)
    np.testing.assert_array_equal(voxels, correct.voxels)
    valid = np.isfinite(correct.targets.disparity_per_m)
    assert (targets.disparity_per_m[valid] <= correct.targets.disparity_per_m[valid]).all()


def test_packets_are_dropped_whole() -> None:
    """About the share of the packets is missing; what is left of a packet is all of it."""
    times_us = np.sort(np.random.default_rng(3).integers(0, 200 * PACKET_US, 5000))
    events = np.stack([np.zeros_like(times_us)] * 2 + [times_us, np.zeros_like(times_us)], axis=1)
    left = drop_packets(0.5, 1, events)
    before, after = (np.bincount(each[:, 2] // PACKET_US, minlength=200) for each in (events, left))
    assert set(np.flatnonzero(after != before)) == set(np.flatnonzero((after == 0) & (before > 0)))
    assert 0.35 < np.mean(after == 0) < 0.65


def test_pose_noise_has_its_size() -> None:
    """The scatter of positions and of rotations is that of the arguments, within 5%."""
    count = 4000
    identity = np.tile([0.0, 0, 0, 1], (count, 1))
    positions, orientations = add_pose_noise(0.01, 0.02, 1, np.zeros((count, 3)), identity)
    assert positions.std() == pytest.approx(0.01, rel=0.05)
    assert so3.log_quaternion(orientations).std() == pytest.approx(0.02, rel=0.05)


def test_planted_faults_are_causes_that_checks_measure() -> None:
    """Causes and streams exist, names are unique, and codes are of checks of the catalogue."""
    checks = {check.name for check in CHECKS}
    assert len({fault.name for fault in PLANTED}) == len(PLANTED)
    for fault in PLANTED:
        stream, cause = fault.cause.split(":")
        assert stream in CAUSES[cause].streams
        assert {code.rpartition(".")[0] for code in fault.codes} <= checks


def test_material_sizes_are_those_of_the_table() -> None:
    """A delay is held against 0.1 ms, a gain against 0.5%, index maps against every deviation."""
    late = material_size(fault_of("events:time_offset", 2))
    row = materiality_row("event_response.timing.offset", "ms")
    assert row is not None
    assert late == ("event_response.timing.offset", row.training)
    assert material_size(fault_of("flow:flow_gain", 2)) == ("flow_photometric.residual.gain", 0.5)
    assert material_size(fault_of("events:threshold_misdeclared", 10)) == ("event_response.threshold.size", 5.0)
    assert material_size(fault_of("depth_to_event:index_off_by_one", 1)) == ("index_maps.depth.entry", 0.0)


def test_costs_leave_the_noise_only_where_they_do() -> None:
    """Of two faults one costs ten times the scatter and the other nothing; intervals hold the true costs."""
    rng = np.random.default_rng(4)
    correct = rng.normal(0.5, 0.01, 6)
    costs = costs_of(correct, {"dear": rng.normal(0.6, 0.01, 4), "free": rng.normal(0.5, 0.01, 4)})
    assert costs["dear"].leaves_noise
    assert costs["dear"].low < 0.1 < costs["dear"].high
    assert not costs["free"].leaves_noise


def test_the_interval_of_a_single_fault_is_students() -> None:
    """With one fault there is nothing to compare together: Student's t with the pooled variance; with five, wider."""
    rng = np.random.default_rng(5)
    correct, faulty = rng.normal(size=6), rng.normal(size=3)
    (cost,) = costs_of(correct, {"only": faulty}).values()
    expected = ttest_ind(faulty, correct).confidence_interval(0.95)
    assert (cost.low, cost.high) == pytest.approx((expected.low, expected.high), rel=1e-2)
    five = costs_of(correct, {"only": faulty, **{str(k): rng.normal(size=3) for k in range(4)}})
    assert five["only"].high - five["only"].low > 1.05 * (cost.high - cost.low)


def test_the_least_costly_size_is_one_above_which_all_cost() -> None:
    """A smaller size that happens to cost does not count where a larger one does not."""
    dear, free = Cost(1, 0.5, 1.5), Cost(0, -1, 1)
    assert least_costly_size({0.5: free, 2: dear, 10: dear}) == 2
    assert least_costly_size({0.5: dear, 2: free, 10: dear}) == 10
    assert least_costly_size({0.5: dear, 2: free}) is None


def test_intervals_of_a_mean_are_students() -> None:
    """Of 1, 2, 3 the mean is 2, its standard error 1 / sqrt(3), and Student's t with two degrees of freedom 4.303."""
    mean, half = mean_interval([1, 2, 3])
    assert mean == 2
    assert half == pytest.approx(4.303 / np.sqrt(3), rel=1e-3)


def write_results(results: Results, arrangements: tuple[Arrangement, ...], naee: Mapping[str, float]) -> None:
    """Write results whose errors are 0.4, or as stated by the name of the fault, with a scatter of 0.001."""
    budget = BUDGETS["smoke"]
    for arrangement in arrangements:
        level = naee.get(arrangement.fault.name if arrangement.fault else "", 0.4)
        for seed in range(max(budget.seeds, budget.control_seeds)):
            error = level + 0.001 * seed
            errors = Errors(error, error, error, error, 2.0, 4.0, 0.05, 0.2).to_json()
            values = {"samples": 30, "best_step": 12, "device": "cpu", "seconds": 36.0, "date": "2026-11-26"}
            results.write(
                TrainingRun(arrangement, seed).name,
                {**values, "errors": dict.fromkeys(arrangement.tested_on, errors)},
            )
        trivial = Errors(1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 0.2, 0.2).to_json()
        by_kind = dict.fromkeys(arrangement.tested_on, trivial)
        if arrangement.fault is None:
            results.write(trivial_name(arrangement), dict.fromkeys(("zero", "constant", "mean field"), by_kind))


def test_the_page_says_what_was_not_run(tmp_path: Path) -> None:
    """Without any result each part says so, and no price is published."""
    text = page(Results(tmp_path), "smoke", 1000)
    assert text.count("Not run.") == 4
    assert "The full study was not run" in " ".join(text.split())
    assert fault_prices(Results(tmp_path), "smoke").prices == ()


def test_the_page_holds_the_papers_numbers_beside_ours(tmp_path: Path) -> None:
    """Rates, cross-tests, pose and prices each have a row, with costs in bold where they leave the noise."""
    results = Results(tmp_path)
    late = fault_of("events:time_offset", 10)
    faults = [Arrangement("flying", fault=fault) for fault in PLANTED if fault.cause == "events:time_offset"]
    write_results(results, (*arrangements_of("a"), *arrangements_of("b"), *faults), {late.name: 0.8})
    text = page(results, "smoke", 1000)
    assert "Not run." not in text
    assert "| NAEE of flow falls from 10 to 50 Hz, iso-time | 0.794 to 0.398 |" in text
    assert "| 10 Hz | 18.841 | 13.44 | 0.794 |" in text
    assert "| flying | driving |" in text
    assert "2.77" in text
    assert "**+0.400" in text
    assert "| events are late | event_response.timing.offset | 0.1 ms | from 10 ms on | stays |" in text
    assert "| flow is too large, 2 percent | generator | not run |" in text


def test_only_what_was_measured_is_published(tmp_path: Path) -> None:
    """A fault without its runs has no price; the table is the same when read again, by the check that measures it."""
    results = Results(tmp_path)
    late = fault_of("events:time_offset", 10)
    write_results(results, (Arrangement("flying"), Arrangement("flying", fault=late)), {late.name: 0.8})
    prices = fault_prices(results, "smoke")
    assert {price.cause for price in prices.prices} == {late.cause}
    assert [price.metric for price in prices.of("event_response.timing")] == list(METRICS.values())
    assert prices.of("imu.noise") == ()
    write_fault_prices(prices, tmp_path / "prices.json")
    assert read_fault_prices(tmp_path / "prices.json") == prices
