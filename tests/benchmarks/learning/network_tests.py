"""What needs PyTorch: `make study-learning-smoke` runs these tests in the study's own environment."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.benchmarks.learning.budget import BINS, BUDGETS, EVENT_SIZE
from tests.benchmarks.learning.mirroring import MIRRORED_FLOW, MIRRORED_MOTION
from tests.benchmarks.learning.network import MotionNetwork, TargetScales, loss_of, predict
from tests.benchmarks.learning.samples import MOTION_COLUMNS, Samples, Targets
from tests.benchmarks.learning.training import _mirrored, scales_of, train

WIDTH, HEIGHT = EVENT_SIZE
UNIT = TargetScales(1.0, 1.0, 1.0, 1.0)


def sliding(count: int, seed: int) -> Samples:
    """Vertical edges that slide by up to 4 px to either side: the flow is what moves them, and so is the motion."""
    rng = np.random.default_rng(seed)
    voxels = np.zeros((count, BINS, HEIGHT, WIDTH), np.float32)
    shifts_px = rng.uniform(-4, 4, count).astype(np.float32)
    for sample, shift_px in enumerate(shifts_px):
        for edge, sign in zip(rng.integers(8, WIDTH - 8, 6), rng.choice((-1.0, 1.0), 6), strict=True):
            for place in range(BINS):
                voxels[sample, place, :, round(edge + shift_px * place / (BINS - 1))] += sign
    flow_px = np.zeros((count, 2, HEIGHT, WIDTH), np.float32)
    flow_px[:, 0] = shifts_px[:, None, None]
    motion = np.zeros((count, MOTION_COLUMNS), np.float32)
    motion[:, 1], motion[:, 5] = shifts_px, 0.1 * shifts_px
    return Samples(voxels, Targets(flow_px, np.full((count, HEIGHT, WIDTH), 0.2, np.float32), motion))


def test_an_untrained_network_predicts_about_the_mean_disparity() -> None:
    """Outputs have the shapes of the targets; without events disparity is near its mean, and flow near zero."""
    torch.manual_seed(0)
    network = MotionNetwork(TargetScales(3.0, 0.25, 1.0, 0.1), 1.0, torch.zeros(MOTION_COLUMNS))
    predicted = predict(network, torch.zeros(3, BINS, HEIGHT, WIDTH), batch=2)
    assert predicted.flow_px.shape == (3, 2, HEIGHT, WIDTH)
    assert predicted.disparity_per_m.shape == (3, HEIGHT, WIDTH)
    assert predicted.motion.shape == (3, MOTION_COLUMNS)
    np.testing.assert_allclose(predicted.disparity_per_m, 0.25, rtol=0.2)
    assert np.abs(predicted.flow_px).max() < 1.0


def test_the_loss_is_the_sum_of_the_normalised_errors() -> None:
    """Zero flow has a NAEE of 1, disparity twice the mean a NADE of 1; invalid pixels count nowhere."""
    flow = torch.zeros(1, 2, HEIGHT, WIDTH)
    flow[:, 0] = 2.0
    flow[:, :, 0] = torch.nan
    disparity = torch.full((1, HEIGHT, WIDTH), 0.5)
    disparity[:, 0] = torch.nan
    motion = torch.tensor([[3.0, 0, 0, 0, 0.1, 0]])
    scales = TargetScales(2.0, 0.5, 3.0, 0.1)
    outputs = torch.zeros(1, 2, HEIGHT, WIDTH), torch.full((1, HEIGHT, WIDTH), 1.0), torch.zeros(1, MOTION_COLUMNS)
    assert float(loss_of(outputs, (flow, disparity, motion), scales)) == pytest.approx(1 + 1 + 1, abs=1e-3)
    same = torch.nan_to_num(flow), torch.nan_to_num(disparity), motion
    assert float(loss_of(same, (flow, disparity, motion), scales)) == pytest.approx(0, abs=1e-3)


def test_mirroring_twice_changes_nothing() -> None:
    """Once it turns columns around and changes the signs of u, of the lateral motion, of roll and of yaw."""
    samples = sliding(2, seed=1)
    arrays = (samples.voxels, samples.targets.flow_px, samples.targets.disparity_per_m, samples.targets.motion)
    batch = tuple(torch.from_numpy(values) for values in arrays)
    mirror = torch.tensor([True, False])
    signs = torch.from_numpy(MIRRORED_FLOW), torch.from_numpy(MIRRORED_MOTION)
    once = _mirrored(batch, mirror, signs)
    np.testing.assert_array_equal(once[0][0].numpy(), samples.voxels[0, :, :, ::-1])
    np.testing.assert_array_equal(once[1][0, 0].numpy(), -samples.targets.flow_px[0, 0, :, ::-1])
    np.testing.assert_array_equal(once[3][0].numpy(), samples.targets.motion[0] * MIRRORED_MOTION)
    np.testing.assert_array_equal(once[0][1].numpy(), samples.voxels[1])
    for values, before in zip(_mirrored(once, mirror, signs), batch, strict=True):
        np.testing.assert_array_equal(values.numpy(), before.numpy())


def test_the_same_seed_gives_the_same_network() -> None:
    """Two trainings from one seed end with the same weights; from another seed with others."""
    budget = replace(BUDGETS["smoke"], steps=4, evaluate_every=2)
    samples = sliding(16, seed=2)
    states = [train(samples, samples, budget, seed, "cpu").network.state_dict() for seed in (1, 1, 2)]
    assert all(torch.equal(states[0][name], states[1][name]) for name in states[0])
    assert not all(torch.equal(states[0][name], states[2][name]) for name in states[0])


def test_a_network_learns_what_slides() -> None:
    """On edges that slide, flow and motion of samples that it has not seen are better than zero and than the mean."""
    budget = replace(BUDGETS["smoke"], steps=200, evaluate_every=50, patience=4)
    training, unseen = sliding(256, seed=3), sliding(32, seed=4)
    trained = train(training, sliding(32, seed=5), budget, 0, "cpu")
    predicted = predict(trained.network, torch.from_numpy(unseen.voxels))
    scales = scales_of(unseen)
    naee = np.linalg.norm(predicted.flow_px - unseen.targets.flow_px, axis=1).mean() / scales.flow_px
    nae = np.linalg.norm((predicted.motion - unseen.targets.motion)[:, :3], axis=1).mean() / scales.translation_m
    assert naee < 0.5
    assert nae < 0.5


def test_training_stops_early() -> None:
    """Where validation has nothing in common with the training set, training ends long before the last step."""
    budget = replace(BUDGETS["smoke"], steps=2000, evaluate_every=5, patience=2)
    training, unrelated = sliding(8, seed=6), sliding(8, seed=7)
    unrelated = Samples(np.random.default_rng(8).permutation(unrelated.voxels), unrelated.targets)
    trained = train(training, unrelated, budget, 0, "cpu")
    assert trained.steps < 1000
    assert trained.best_step <= trained.steps
