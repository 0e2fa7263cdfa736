"""Vignetting of colour frames, in a closed-form world that exists in memory."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.images.vignetting import ImagesVignetting, squared_radius
from fedora_qa.estimators.images.luma import to_code, to_linear
from fedora_qa.sequence.declared import PoseModel
from tests.support.facts import exact_facts
from tests.support.flow_world import HEIGHT, WIDTH, FlowWorld, K, judged, make_world, observe

Float64 = NDArray[np.float64]
LEFT, TOP = 40, 10


@pytest.fixture(scope="module")
def world() -> FlowWorld:
    return make_world((10, 50))


def squares() -> Float64:
    """(H, W) squared tangent of each pixel's angle to the optical axis over the largest of all."""
    x, y = np.meshgrid((np.arange(WIDTH) - K[0, 2]) / K[0, 0], (np.arange(HEIGHT) - K[1, 2]) / K[1, 1])
    return np.asarray((x**2 + y**2) / (x**2 + y**2).max())


def darkened(world: FlowWorld, gains: Float64) -> FlowWorld:
    """The same file with frames multiplied by (H, W), or (N, H, W), in linear light."""
    transfer = world.facts.declared.transfer
    linear = to_linear(np.asarray(world.rows_by_key["path/rgb"], np.float64), transfer)
    return world.with_rows(path_rgb=np.rint(to_code(linear * gains[..., np.newaxis], transfer)).astype(np.uint8))


def loss_of(world: FlowWorld) -> tuple[float, float]:
    """Fitted loss and its standard error, percent."""
    (statistic,) = observe(ImagesVignetting(), world).measurements
    return statistic.value, statistic.standard_error


@pytest.mark.parametrize("rates", [(10,), (25,), (50,), (10, 25, 50)], ids=str)
def test_clean_frames_pass(rates: tuple[int, ...]) -> None:
    """Every rate of the flow will do."""
    result = judged(ImagesVignetting(), make_world(rates)).result
    assert (result.outcome, result.reason) == ("passed", "")


def test_pose_noise_does_not_matter() -> None:
    """The flow leads from frame to frame, not the pose."""
    assert judged(ImagesVignetting(), make_world((10,), noise=PoseModel(0.02, 0.01))).result.outcome == "passed"


@pytest.mark.parametrize("percent", [10.0, 30.0, 60.0, -20.0])
def test_loss_is_measured_and_named(world: FlowWorld, percent: float) -> None:
    """An exponential fall-off, or the centre that is darker, with its size and sign."""
    fall_off = np.exp(np.log1p(-abs(percent) / 100) * (squares() if percent > 0 else 1 - squares()))
    result = judged(ImagesVignetting(), darkened(world, fall_off))
    (alarm,) = result.alarms
    best = max(hypotheses_of(alarm, exact_facts()), key=lambda hypothesis: hypothesis.support)
    assert (best.stream, best.cause) == ("rgb", "vignetting")
    assert best.magnitude == pytest.approx(percent, abs=1.5)


@pytest.mark.parametrize("fall_off", [lambda s: 1 - 0.3 * s, lambda s: (1 + 0.1952 * s) ** -2], ids=["r2", "cos4"])
def test_other_laws_have_nearly_the_same_loss(world: FlowWorld, fall_off: Any) -> None:
    """1 - 0.3 r^2, and cos^4 = (1 + tan^2)^-2, both 0.7 in the corner, are measured as 30% within 3."""
    assert loss_of(darkened(world, fall_off(squares())))[0] == pytest.approx(30.0, abs=3.0)


def test_exposure_of_single_frames_does_not_matter(world: FlowWorld) -> None:
    """Each frame has an exposure of its own: no loss, and beside it the same loss."""
    gains = np.random.default_rng(3).uniform(0.7, 1.0, len(world.rows_by_key["path/rgb"]))[:, None, None]
    assert judged(ImagesVignetting(), darkened(world, gains * np.ones((HEIGHT, WIDTH)))).result.outcome == "passed"
    assert loss_of(darkened(world, gains * np.exp(np.log(0.8) * squares())))[0] == pytest.approx(20.0, abs=1.5)


@pytest.mark.parametrize("transfer", ["srgb", "gamma2.2"])
def test_declared_transfer_is_undone(world: FlowWorld, transfer: Any) -> None:
    """The loss is that of linear light."""
    linear = np.asarray(world.rows_by_key["path/rgb"], np.float64)
    encoded = world.with_rows(path_rgb=np.rint(to_code(linear, transfer)).astype(np.uint8)).declaring(transfer=transfer)
    assert loss_of(darkened(encoded, np.exp(np.log(0.8) * squares())))[0] == pytest.approx(20.0, abs=1.5)


def test_cropped_frames_are_measured_about_the_optical_axis(world: FlowWorld) -> None:
    """Colour without its left and upper part: the loss in the corner that is farthest from the principal point."""
    cropped = darkened(world, np.exp(np.log(0.7) * squares()))
    frames = np.ascontiguousarray(np.asarray(cropped.rows_by_key["path/rgb"])[:, TOP:, LEFT:])
    camera = cropped.facts.declared.cameras["rgb"]
    moved = K - np.array([[0, 0, LEFT], [0, 0, TOP], [0, 0, 0]])
    smaller = replace(camera, width=WIDTH - LEFT, height=HEIGHT - TOP, K=moved)
    cropped = cropped.with_rows(path_rgb=frames).declaring(cameras={"rgb": smaller, "depth": camera})
    farthest = float(squares()[TOP:, LEFT:].max())
    assert loss_of(cropped)[0] == pytest.approx(100 * (1 - 0.7**farthest), abs=1.5)


def test_radius_is_about_the_principal_point() -> None:
    """0 at the principal point and 1 in the farthest corner."""
    camera = make_world((50,)).facts.declared.cameras["rgb"]
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    np.testing.assert_allclose(squared_radius(camera, x, y), squares(), rtol=1e-12)
    assert squared_radius(camera, K[:1, 2], K[1:2, 2]) == 0


def test_still_or_dark_or_blank_frames_are_not_observable(world: FlowWorld) -> None:
    """Surfaces that stay where they are, or are lost in rounding, or clipped, tell nothing."""
    rows, check = world.rows_by_key, ImagesVignetting()
    still = world.with_flow(lambda _, flow: np.zeros_like(flow)).with_rows(
        path_rgb=np.repeat(rows["path/rgb"][:1], len(rows["path/rgb"]), axis=0)
    )
    dark = world.with_rows(path_rgb=rows["path/rgb"] // 64)
    white = world.with_rows(path_rgb=np.full_like(rows["path/rgb"], 255))
    for unseen in (still, dark, white):
        result = judged(check, unseen.without("pose")).result
        assert (result.outcome, result.findings) == ("not_observable", ())
        assert result.reason


def test_without_a_camera_it_does_not_apply(world: FlowWorld) -> None:
    """No principal point is known; and frames of a camera elsewhere are not on the flow's grid."""
    check = ImagesVignetting()
    assert "not declared" in check.not_applicable(world.declaring(cameras={}).facts)
    camera = world.facts.declared.cameras["rgb"]
    away = camera.T_body_camera.copy()
    away[0, 3] += 0.2
    apart = world.declaring(cameras={"rgb": replace(camera, T_body_camera=away), "depth": camera})
    assert "position of the depth camera" in check.not_applicable(apart.facts)
