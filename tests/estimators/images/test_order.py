"""How far one frame lies from another along a flow."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2
from fedora_qa.estimators.images.order import flow_ratio, flow_ratios_of_parts

Float32 = NDArray[np.float32]
HEIGHT, WIDTH = 150, 200
_RNG = np.random.default_rng(2)
WAVES = [(*_RNG.normal(0, 0.25, 2), _RNG.uniform(0, 2 * np.pi)) for _ in range(30)]


def frame(share: float, flow_px: Float32, gain: float = 1.0) -> Float32:
    """A closed-form texture carried by a share of the flow (to first order: constant or linear in place)."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    columns, rows = columns - share * flow_px[..., 0], rows - share * flow_px[..., 1]
    total = sum(np.cos(kx * columns + ky * rows + phase) for kx, ky, phase in WAVES)
    return np.asarray(np.rint(gain * (110 + 8 * np.asarray(total))), dtype=np.float32)


def as_read(flow_px: Float32) -> Float32:
    """The flow as checks get it, which may not write into what was decoded; loops are compiled for that."""
    flow_px.flags.writeable = False
    return flow_px


def pan(u: float, v: float) -> Float32:
    return as_read(np.broadcast_to(np.array([u, v], dtype=np.float32), (HEIGHT, WIDTH, 2)).copy())


def expansion(rate: float) -> Float32:
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    return as_read(np.stack([rate * (columns - WIDTH / 2), rate * (rows - HEIGHT / 2)], axis=-1))


@pytest.mark.parametrize("share", [0.0, 1.0, -1.0, 2.0], ids=["frozen", "in order", "turned round", "one left out"])
@pytest.mark.parametrize("flow_px", [pan(1.2, -0.7), pan(6.0, 3.0), expansion(0.01)], ids=["pan", "fast", "forward"])
def test_share_is_found(share: float, flow_px: Float32) -> None:
    """Frozen, right, reversed and skipped frames read nearer to 0, 1, -1, 2 than to each other."""
    found = flow_ratio(frame(0.0, flow_px), frame(share, flow_px), flow_px)
    assert found is not None
    assert found.ratio == pytest.approx(share, abs=0.05 + 0.3 * abs(share))
    assert found.rounding_error < 0.01


def test_rounding_error_is_that_of_repetition() -> None:
    """White noise of the variance of rounded luma, in both frames, scatters the ratio as stated."""
    flow_px = pan(1.0, 0.5)
    rng, sigma_dn = np.random.default_rng(5), LUMA_ROUNDING_VARIANCE_DN2**0.5
    frames = [frame(share, flow_px) for share in (0.0, 1.0)]
    ratios, errors = [], []
    for _ in range(60):
        noisy = [(each + rng.normal(0, sigma_dn, each.shape)).astype(np.float32) for each in frames]
        found = flow_ratio(noisy[0], noisy[1], flow_px)
        assert found is not None
        ratios.append(found.ratio)
        errors.append(found.rounding_error)
        assert found.standard_error >= found.rounding_error
    assert np.std(ratios) == pytest.approx(np.mean(errors), rel=0.35)


def test_standard_error_is_that_of_repetition() -> None:
    """Noise far above rounding, which nothing declares, scatters the ratio as its residuals tell."""
    flow_px, rng = pan(1.0, 0.5), np.random.default_rng(7)
    frames = [frame(share, flow_px) for share in (0.0, 1.0)]
    ratios, errors = [], []
    for _ in range(60):
        noisy = [(each + rng.normal(0, 3.0, each.shape)).astype(np.float32) for each in frames]
        found = flow_ratio(noisy[0], noisy[1], flow_px)
        assert found is not None
        ratios.append(found.ratio)
        errors.append(found.standard_error)
    assert np.std(ratios) == pytest.approx(np.mean(errors), rel=0.35)


def test_exposure_is_no_motion() -> None:
    """A frame that is 20% brighter lies where it lies."""
    flow_px = pan(1.0, 0.5)
    found = flow_ratio(frame(0.0, flow_px), frame(1.0, flow_px, gain=1.2), flow_px)
    assert found is not None
    assert found.ratio == pytest.approx(1.0, abs=0.1)


def test_missing_flow_is_left_out() -> None:
    """NaN and absurd values in half of the image change nothing."""
    flow_px = pan(1.0, 0.5)
    before, after = frame(0.0, flow_px), frame(1.0, flow_px)
    damaged_px = flow_px.copy()
    damaged_px[: HEIGHT // 2] = np.nan
    damaged_px[HEIGHT // 2 : HEIGHT // 2 + 5] = 1e9
    found = flow_ratio(before, after, as_read(damaged_px))
    assert found is not None
    assert found.ratio == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("before", "flow_px"),
    [
        (np.full((HEIGHT, WIDTH), 90, np.float32), pan(1.0, 0.5)),
        (frame(0.0, pan(0, 0)), as_read(np.full((HEIGHT, WIDTH, 2), np.nan, np.float32))),
        (frame(0.0, pan(0, 0))[:5, :5].copy(), as_read(pan(1.0, 0.5)[:5, :5].copy())),
        (frame(0.0, pan(0, 0)), pan(300.0, 0.0)),
    ],
    ids=["no texture", "no flow", "tiny", "flow larger than the image"],
)
def test_what_cannot_tell_says_nothing(before: Float32, flow_px: Float32) -> None:
    """Without texture, flow or pixels there is no share."""
    assert flow_ratio(before, before, flow_px) is None


def test_resting_camera_has_no_share() -> None:
    """Where nothing moves the share is unknown: no value, or an error that says so."""
    still = pan(0.0, 0.0)
    found = flow_ratio(frame(0.0, still), frame(0.0, still), still)
    assert found is None or found.standard_error > 1


PARTS = [(left, top, left + 80, top + 60) for top in (10, 80) for left in (10, 110)]


@pytest.mark.parametrize("share", [0.0, 1.0, -1.0, 2.0], ids=["frozen", "in order", "turned round", "one left out"])
def test_parts_together_tell_what_the_whole_does(share: float) -> None:
    """Some parts, each reduced by its own flow, give the share of the whole frame, brighter by a tenth or not."""
    flow_px = expansion(0.04)
    before, after = frame(0.0, flow_px), frame(share, flow_px, gain=1.1)
    together, apart = flow_ratios_of_parts(before, after, flow_px, PARTS)
    assert together is not None
    assert together.ratio == pytest.approx(share, abs=0.05 + 0.3 * abs(share))
    assert together.standard_error < 0.1
    assert [one is not None for one in apart] == [True] * len(PARTS)


def test_one_part_together_is_that_part() -> None:
    """The sums of one part say together what they say alone."""
    flow_px = expansion(0.03)
    together, (alone,) = flow_ratios_of_parts(frame(0.0, flow_px), frame(1.0, flow_px), flow_px, PARTS[:1])
    assert together is not None
    assert alone is not None
    assert together.ratio == pytest.approx(alone.ratio, rel=1e-9)
    assert together.standard_error == pytest.approx(alone.standard_error, rel=1e-9)
    assert together.rounding_error == pytest.approx(alone.rounding_error, rel=1e-9)


def test_parts_that_cannot_tell_say_nothing() -> None:
    """Without valid flow neither the parts nor all of them together have a share."""
    flow_px = as_read(np.full((HEIGHT, WIDTH, 2), np.nan, np.float32))
    image = frame(0.0, pan(0, 0))
    assert flow_ratios_of_parts(image, image, flow_px, PARTS) == (None, [None] * len(PARTS))
