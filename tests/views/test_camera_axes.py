"""A colour camera that is turned by quarters sees the same rays at the pixels to which its image is turned."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fedora_qa.sequence.declared import Camera, Declared
from fedora_qa.views.camera_axes import look_apart, quarter_turns, turned_colour_camera, turned_frame
from tests.support.memory_sequence import memory_sequence

ANGLES_DEG = st.floats(-180.0, 180.0)


def declared_with(R_rgb_events: Rotation) -> Declared:
    """Return a rig whose colour camera has no centre in the middle and two focal lengths."""
    R_body_rgb = Rotation.from_euler("xyz", (10.0, -25.0, 40.0), degrees=True)
    T_rgb, T_events = np.eye(4), np.eye(4)
    T_rgb[:3, :3], T_events[:3, :3] = R_body_rgb.as_matrix(), (R_body_rgb * R_rgb_events).as_matrix()
    rgb = Camera(12, 9, np.array([[11.0, 0, 5.3], [0, 10.0, 4.2], [0, 0, 1]]), T_rgb)
    events = Camera(10, 8, np.array([[9.0, 0, 4.5], [0, 9.0, 3.5], [0, 0, 1]]), T_events)
    return replace(memory_sequence().declared, cameras={"rgb": rgb, "events": events})


def rays(camera: Camera, columns: Any, rows: Any) -> Any:
    """Return the directions of pixels (n, 3) in the body, with unit depth."""
    directions = np.linalg.inv(camera.K) @ np.stack([columns, rows, np.ones(len(columns))])
    return (camera.T_body_camera[:3, :3] @ directions).T


@pytest.mark.parametrize("turns", range(4))
def test_rays_and_values_stay_together(turns: int) -> None:
    """Each pixel of the turned image has the value and the ray of the pixel from which it came."""
    declared = declared_with(Rotation.from_euler("z", 90.0 * turns, degrees=True))
    before, after = declared.cameras["rgb"], turned_colour_camera(declared)
    numbers = np.arange(before.width * before.height).reshape(before.height, before.width)
    window: Any = SimpleNamespace(facts=SimpleNamespace(declared=declared))
    turned = turned_frame(window, numbers)
    assert turned.shape == (after.height, after.width)
    rows, columns = (each.ravel() for each in np.indices(turned.shape))
    old_rows, old_columns = np.divmod(turned.ravel(), before.width)
    assert rays(after, columns, rows) == pytest.approx(rays(before, old_columns, old_rows), abs=1e-12)
    # Its axes are those of the event camera.
    assert after.T_body_camera[:3, :3] == pytest.approx(declared.cameras["events"].T_body_camera[:3, :3], abs=1e-12)


@given(turns=st.integers(0, 3), tilt_deg=st.floats(0.0, 9.9), direction=st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_small_rotations_beside_quarter_turns_do_not_look_apart(
    turns: int, tilt_deg: float, direction: tuple[float, float, float]
) -> None:
    length = float(np.linalg.norm(direction))
    axis = np.array(direction) / length if length > 1e-3 else np.array([1.0, 0.0, 0.0])
    tilt = Rotation.from_rotvec(np.deg2rad(tilt_deg) * axis)
    declared = declared_with(Rotation.from_euler("z", 90.0 * turns, degrees=True) * tilt)
    assert quarter_turns(declared.cameras["rgb"], declared.cameras["events"]) == turns
    assert not look_apart(declared)


@given(pitch_deg=st.floats(10.5, 169.5), roll_deg=ANGLES_DEG)
def test_optical_axes_that_differ_look_apart(pitch_deg: float, roll_deg: float) -> None:
    """Whatever the rotation about the optical axis is."""
    declared = declared_with(Rotation.from_euler("xz", (pitch_deg, roll_deg), degrees=True))
    assert look_apart(declared)
    assert turned_colour_camera(declared) is declared.cameras["rgb"]
