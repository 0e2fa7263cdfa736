"""How the axes of two cameras of a rig differ, and the colour camera after quarter turns to those of the events."""

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.declared import Camera, Declared
from fedora_qa.sequence.window import Window

CENTRES_AGREE_M: Final = 1e-6
"""Largest distance of two cameras along an axis, m, at which they have one centre."""

AXES_AGREE: Final = 1e-6
"""Largest difference of the elements of two rotations that are equal."""

_FARTHEST_ROTATION_RAD: Final = np.deg2rad(10.0)
"""Rows of a camera are slanted lines in a camera that is rotated further."""

_TURNS: Final = 4
"""Quarter turns of a whole turn."""


def is_about_parallel(camera1: Camera, camera2: Camera) -> bool:
    """Whether the axes of two cameras differ by a rotation of 10 deg at most."""
    R_second_first = camera2.T_body_camera[:3, :3].T @ camera1.T_body_camera[:3, :3]
    return _is_small(R_second_first)


def differ_by_quarters(rgb: Camera, events: Camera, *, about: bool) -> bool:
    """Whether the axes differ by quarter turns about the optical axis; ``about``: up to a rotation of 10 deg."""
    R_rgb_events = rgb.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
    rest = _quarters_about_z(quarter_turns(rgb, events)).T @ R_rgb_events
    return _is_small(rest) if about else is_identity(rest)


def look_apart(declared: Declared) -> bool:
    """Whether the declared axes of colour and event camera differ by more than 10 deg, beside ``quarter_turns``."""
    rgb, events = declared.cameras["rgb"], declared.cameras["events"]
    R_rgb_events = rgb.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
    return _is_rotation(R_rgb_events) and not differ_by_quarters(rgb, events, about=True)


def quarter_turns(rgb: Camera, events: Camera) -> int:
    """Return how many quarter turns, from x to y, bring the axes of the colour camera within 10 deg of those of events.

    0 to 3; 0 where none do.
    """
    R_rgb_events = rgb.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
    turned = (turns for turns in range(_TURNS) if _is_small(_quarters_about_z(turns).T @ R_rgb_events))
    return next(turned, 0)


def turned_colour_camera(declared: Declared) -> Camera:
    """Return the colour camera after ``quarter_turns``: the camera of ``turned_frame``."""
    camera = declared.cameras["rgb"]
    turns = quarter_turns(camera, declared.cameras["events"])
    K, width, height = camera.K, camera.width, camera.height
    for _ in range(turns):
        # After a quarter turn column u' is row v, and row v' is column W - 1 - u.
        K = np.array([[K[1, 1], 0.0, K[1, 2]], [0.0, K[0, 0], width - 1 - K[0, 2]], [0.0, 0.0, 1.0]])
        width, height = height, width
    T_body_camera = camera.T_body_camera.copy()
    T_body_camera[:3, :3] = T_body_camera[:3, :3] @ _quarters_about_z(turns)
    return replace(camera, K=K, width=width, height=height, T_body_camera=T_body_camera) if turns else camera


def turned_frame(window: Window, image: NDArray[Any]) -> NDArray[Any]:
    """Return a colour frame (h, w, ...) as the colour camera sees it after ``quarter_turns``."""
    cameras = window.facts.declared.cameras
    turns = quarter_turns(cameras["rgb"], cameras["events"])
    return np.ascontiguousarray(np.rot90(image, turns)) if turns else image


def _quarters_about_z(turns: int) -> NDArray[np.float64]:
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns]
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _is_rotation(R: NDArray[np.float64]) -> bool:
    """Whether a matrix (3, 3), not a number where it is damaged, is orthogonal."""
    return bool(np.abs(R @ R.T - np.eye(3)).max() <= AXES_AGREE)


def is_identity(R: NDArray[np.float64]) -> bool:
    """Whether a rotation (3, 3) turns nothing, within ``AXES_AGREE``."""
    return bool(np.abs(R - np.eye(3)).max() <= AXES_AGREE)


def _is_small(R: NDArray[np.float64]) -> bool:
    """Whether a rotation is one of 10 deg at most."""
    # The trace of a rotation is 1 + 2 cos(angle).
    return _is_rotation(R) and bool(np.trace(R) >= 1 + 2 * np.cos(_FARTHEST_ROTATION_RAD))


def why_not_one_lens(camera1: Camera, camera2: Camera, names: tuple[str, str]) -> str:
    """Return why two cameras distort a ray differently, with their names in the sentence; empty where they do not."""
    if camera1.lens == camera2.lens:
        return ""
    models = [each.lens.model if each.lens else "no distortion" for each in (camera1, camera2)]
    return (
        f"the cameras {names[0]} and {names[1]} have different lenses ({models[0]}, {models[1]}), whose images differ "
        "by more than a scale; the check needs equal lenses"
    )
