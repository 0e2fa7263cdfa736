"""Numbers of a camera that look chosen, and those that do not once they are wrong by any amount."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.checks.flow_geometry.endpoint import FieldsOff, FlowGainFit, FlowRatesOff
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.designed_cameras import is_chosen
from fedora_qa.diagnosis.flow_geometry import propose_endpoint
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.declared import Camera
from fedora_qa.views.flow_conventions import ConventionTrial

FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def camera(
    view_deg: float = 60.0, centre_off_px: float = 0.0, turn_deg: tuple[float, float, float] = (0, 0, 0)
) -> Camera:
    width, height = 270, 200
    f = width / (2 * np.tan(np.radians(view_deg) / 2))
    K = np.array([[f, 0, (width - 1) / 2 + centre_off_px], [0, f, (height - 1) / 2], [0, 0, 1]])
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3] = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix() @ FORWARD
    return Camera(width, height, K, T_body_camera)


CAUSES = ("intrinsics_focal", "intrinsics_centre", "extrinsic_rotation")


@pytest.mark.parametrize("cause", CAUSES)
@pytest.mark.parametrize("view_deg", [45.0, 60.0, 90.0])
def test_designed_camera_looks_chosen(cause: str, view_deg: float) -> None:
    """A round view, a centre in the middle, a look straight ahead."""
    assert is_chosen(camera(view_deg), cause)


def test_round_tilt_and_whole_focal_length_look_chosen() -> None:
    """20 degrees down, 234 px, and a principal point at W / 2."""
    assert is_chosen(camera(turn_deg=(0, 20, 0)), "extrinsic_rotation")
    whole = camera(centre_off_px=0.5)
    K = whole.K.copy()
    K[0, 0] = K[1, 1] = 234.0
    assert is_chosen(replace(whole, K=K), "intrinsics_focal")
    assert not is_chosen(camera(), "time_offset")


@example(error=0.05)
@given(error=st.floats(1e-5, 0.05))
def test_what_is_off_by_any_amount_does_not(error: float) -> None:
    """A millionth of the view, 1e-4 px, 1e-5 degrees and more, short of the next round number.

    A view of 60 degrees has a focal length of 233.83 px. At 60.07 degrees it is 233.5 px, which is round again: the
    view is at most 0.1% too wide, 60.06 degrees.
    """
    assert not is_chosen(camera(60.0 * (1 + max(1e-6, 0.02 * error))), "intrinsics_focal")
    assert not is_chosen(camera(centre_off_px=0.49 * error / 0.1 + 1e-4), "intrinsics_centre")
    assert not is_chosen(camera(turn_deg=(error, 0, 0)), "extrinsic_rotation")


@pytest.mark.parametrize(("correlation", "is_foreign"), [(0.9999, False), (0.97, True)])
def test_flow_that_follows_the_recomputed_flow_is_of_one_sequence(correlation: float, is_foreign: bool) -> None:
    """Depths of any value fit: blurred depth is of its own sequence, where the flow of both hardly differs."""
    rate = "flow/10hz"
    features = (
        FlowRatesOff({rate: True}),
        FieldsOff(10, 1.0, False, 0, 0),
        FlowGainFit(0.001, 0.001, 0.01, correlation, 0.1),
        ConventionTrial(rate, "triangulated_depth", "depth", 0.9),
    )
    code, where = "flow_geometry.endpoint.error", Where(stream=rate)
    statistic = Statistic("error", 1.0, "px", 0.0, "off", code, where, features=features)
    declared = SimpleNamespace(cameras={"depth": camera()}, pose=None)
    facts: Any = SimpleNamespace(declared=declared, clocks={})
    hypotheses = propose_endpoint(Alarm(Finding("F1", code, "error", "off", where), statistic), facts)
    assert (("other_sequence", "depth") in {(h.cause, h.stream) for h in hypotheses}) is is_foreign


@pytest.mark.parametrize(("count", "cause"), [(4, "time_offset"), (2, "swapped_frames")])
def test_more_fields_in_a_row_than_exchanged_frames_begin_are_those_of_a_while(count: int, cause: str) -> None:
    """Depth that is a frame late for a while, or two frames that were exchanged."""
    rate, times_ns = "flow/50hz", 20_000_000 * np.arange(50)
    features = (
        FlowRatesOff({rate: True}),
        FieldsOff(count, count / 50, False, 0, 0, None, int(times_ns[10]), int(times_ns[9 + count])),
        ConventionTrial(rate, "delayed", "depth", 0.9, 20.0),
        ConventionTrial(rate, "neighbouring_frame", "depth", 0.9, 1.0),
    )
    code, where = "flow_geometry.endpoint.error", Where(stream=rate)
    statistic = Statistic("error", 1.0, "px", 0.0, "off", code, where, features=features)
    declared = SimpleNamespace(cameras={"depth": camera()}, pose=None)
    facts: Any = SimpleNamespace(declared=declared, clocks={rate: SimpleNamespace(times_ns=times_ns)})
    best = propose_endpoint(Alarm(Finding("F1", code, "error", "off", where), statistic), facts)[0]
    assert (best.cause, best.stream) == (cause, "depth")
