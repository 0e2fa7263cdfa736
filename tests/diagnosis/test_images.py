"""Hypotheses for colour frames: repeats, order, exposure, and colours that are not what events measure."""

import pytest

from fedora_qa.checks.images.channels import NearestChannelOrder
from fedora_qa.checks.images.exposure import BrightnessJump, CodesMultiplied
from fedora_qa.checks.images.order import OutOfOrderIntervals
from fedora_qa.checks.images.transfer import CodesBent
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from tests.support.proposals import named, proposed


def test_frames_that_repeat_are_frozen_rather_than_doubled() -> None:
    """Both have the number of the frames, without an error: it is counted."""
    assert proposed("images.repeats.frames", value=4.0) == (
        Hypothesis("frozen_frames", "rgb", 0.95, 4.0, "samples", 0.0),
        Hypothesis("time_offset", "rgb", 0.4),
        Hypothesis("duplicated_samples", "rgb", 0.5, 4.0, "samples", 0.0),
    )


def supports_of_order(intervals: OutOfOrderIntervals) -> dict[str, float]:
    hypotheses = proposed("images.order.share", intervals)
    return {hypothesis.cause: hypothesis.support for hypothesis in hypotheses if hypothesis.stream == "rgb"}


@pytest.mark.parametrize(
    ("ratios", "cause", "size"),
    [
        pytest.param((-1.0, 2.0, -1.0), "swapped_frames", 1.0, id="neighbours exchanged"),
        pytest.param((2.0, -1.0, -1.0, 2.0), "swapped_frames", 2.0, id="frames exchanged that are 2 apart"),
        pytest.param((0.0, 2.0), "frozen_frames", 1.0, id="one frozen frame"),
        pytest.param((0.0, 0.1, 3.0), "frozen_frames", 2.0, id="two frozen frames"),
    ],
)
def test_frames_that_return_to_their_places_left_them(ratios: tuple[float, ...], cause: str, size: float) -> None:
    """A motion that turns round is an exchange, one that stops a frozen frame; the image itself was not moved."""
    intervals = OutOfOrderIntervals(ratios, frames_return=True, isolated=False)
    supports = supports_of_order(intervals)
    assert max(supports, key=lambda name: supports[name]) == cause
    assert (supports[cause], supports["spatial_offset"], supports["mirrored"]) == (0.95, 0.0, 0.0)
    (first,) = (h for h in proposed("images.order.share", intervals) if h.cause == cause and h.stream == "rgb")
    assert (first.magnitude, first.unit) == (size, "samples")


@pytest.mark.parametrize(("isolated", "cause"), [(True, "spatial_offset"), (False, "mirrored")])
def test_frames_that_do_not_return_belong_to_an_image_that_was_moved(isolated: bool, cause: str) -> None:
    """For one interval it was shifted, for many it was turned over; exchanged frames keep a little support."""
    supports = supports_of_order(OutOfOrderIntervals((-1.0,), frames_return=False, isolated=isolated))
    assert max(supports, key=lambda name: supports[name]) == cause
    assert (supports[cause], supports["swapped_frames"]) == (0.8, 0.2)


def test_a_return_that_was_not_measured_leaves_both() -> None:
    """Frames out of their places have 0.6 of their support, a moved image the rest of its own."""
    supports = supports_of_order(OutOfOrderIntervals((-1.0,), frames_return=None, isolated=True))
    assert supports["swapped_frames"] == pytest.approx(0.95 * 0.6)
    assert supports["spatial_offset"] == pytest.approx(0.8 * 0.4)


def test_wrong_flow_may_put_frames_out_of_order() -> None:
    """It has less support than any pattern of the frames that is measured."""
    hypotheses = proposed("images.order.part", OutOfOrderIntervals((0.0, 2.0), frames_return=True, isolated=False))
    of_flow = {hypothesis.cause: hypothesis.support for hypothesis in hypotheses if hypothesis.stream == "flow"}
    assert set(of_flow) == {
        "swapped_frames", "frozen_frames", "flow_interval_shifted", "flow_gain", "flow_sign", "flow_unit",
        "other_sequence", ANY_CAUSE,
    }  # fmt: skip
    assert set(of_flow.values()) == {0.3}


def test_blank_frames_are_an_exposure_or_lost() -> None:
    assert proposed("images.exposure.blank") == (
        Hypothesis("exposure_or_gamma", "rgb", 0.9),
        Hypothesis("dropped_samples", "rgb", 0.3),
    )


def test_a_jump_of_brightness_has_its_size() -> None:
    """Frames of other content may jump as well; those have no size."""
    hypotheses = proposed("images.exposure.jump", BrightnessJump(25.0, 0.5))
    assert hypotheses[:2] == (
        Hypothesis("exposure_or_gamma", "rgb", 0.95, 25.0, "percent", 0.5),
        Hypothesis("channel_order", "rgb", 0.6),
    )
    assert named(hypotheses[2:]) == [("other_sequence", "rgb"), ("swapped_frames", "rgb"), ("frozen_frames", "rgb")]


def test_a_jump_that_grows_towards_the_corners_is_vignetting() -> None:
    """Its size is the loss in the corners, whether vignetting begins or ends; an even gain is left with 0.3."""
    for corner_percent in (-8.0, 8.0):
        assert proposed("images.exposure.jump", BrightnessJump(-2.5, 0.5, corner_percent)) == (
            Hypothesis("vignetting", "rgb", 0.95, 8.0, "percent"),
            Hypothesis("exposure_or_gamma", "rgb", 0.3, -2.5, "percent", 0.5),
        )


def test_multiplied_codes_are_a_gain() -> None:
    """Half of the range of gains that leave the same codes out stands for the error."""
    assert proposed("images.exposure.codes", CodesMultiplied(10.0, 0.2)) == (
        Hypothesis("exposure_or_gamma", "rgb", 0.95, 10.0, "percent", 0.2),
    )


def test_an_order_is_supported_where_another_is_nearest() -> None:
    """Weights that are nearest to R, G, B although they deviate hardly support an exchange."""
    exchanged = proposed("images.channels.order", NearestChannelOrder("BGR"), value=0.9)
    declared = proposed("images.channels.order", NearestChannelOrder("RGB"), value=0.3)
    assert exchanged[0] == Hypothesis("channel_order", "rgb", 0.95)
    assert declared[0] == Hypothesis("channel_order", "rgb", 0.1)
    assert len(exchanged) == len(declared) == 14


@pytest.mark.parametrize(
    ("name", "exponent", "threshold"),
    [
        pytest.param("exponent", 1.3, False, id="bends by level"),
        pytest.param("exponent_at_declared_thresholds", 2.2, False, id="of a display"),
        pytest.param("exponent_at_declared_thresholds", 0.45, False, id="of a display, undone twice"),
        pytest.param("exponent_at_declared_thresholds", 1.3, True, id="of no display"),
    ],
)
def test_an_exponent_may_be_a_threshold(name: str, exponent: float, threshold: bool) -> None:
    """In the log model an exponent that no display has is that of another threshold rather."""
    hypotheses = proposed("images.transfer.exponent", name=name, value=exponent)
    support = {hypothesis.cause: hypothesis.support for hypothesis in hypotheses}
    assert ("threshold_misdeclared" in support) == threshold
    assert support["exposure_or_gamma"] == (0.3 if threshold else 0.95)


def test_codes_that_a_curve_leaves_out_are_no_threshold() -> None:
    """An exponent of no display may be a threshold, but a threshold leaves no code of the frames out."""
    name = "exponent_at_declared_thresholds"
    by_steps, by_codes = (
        {(h.cause, h.stream): h.support for h in proposed("images.transfer.exponent", *features, name=name, value=0.8)}
        for features in ((), (CodesBent(1.25),))
    )
    threshold, curve = ("threshold_misdeclared", "events"), ("exposure_or_gamma", "rgb")
    assert by_steps[threshold] > by_steps[curve]
    assert threshold not in by_codes
    assert by_codes[curve] == 0.95
