"""Which camera is shifted: one shift of one camera must explain the shifts of all pairs."""

import numpy as np
import pytest

from fedora_qa.checks.alignment.edge_shifts import CameraPairShift
from fedora_qa.diagnosis.alignment import shift_hypotheses
from fedora_qa.sequence.declared import Camera
from tests.estimators.event_world import camera_matrix

CAMERAS = {
    name: Camera(width, 3 * width // 4, camera_matrix(width, 3 * width // 4), np.eye(4))
    for name, width in (("depth", 1440), ("rgb", 1440), ("events", 640))
}
RATIO = 640 / 1440


def pair(first: str, second: str, right_px: float) -> CameraPairShift:
    return CameraPairShift(first, second, (right_px, 0.0), (0.05, 0.05))


@pytest.mark.parametrize(
    ("shifted", "size_px", "shifts"),
    [
        ("rgb", 3.0, (3.0, -3.0 * RATIO, 0.0)),
        ("depth", 3.0, (-3.0, 0.0, -3.0 * RATIO)),
        ("events", 2.0, (0.0, 2.0, 2.0)),
    ],
)
def test_shifted_camera_is_identified(shifted: str, size_px: float, shifts: tuple[float, float, float]) -> None:
    """Of three cameras the one whose shift explains all pairs comes first, with its size in its own pixels."""
    pairs = [pair("depth", "rgb", shifts[0]), pair("rgb", "events", shifts[1]), pair("depth", "events", shifts[2])]
    first = shift_hypotheses(pairs, CAMERAS)[0]
    assert (first.cause, first.stream) == ("spatial_offset", shifted)
    assert first.magnitude == pytest.approx(size_px)


def test_centres_of_all_cameras_are_sized() -> None:
    """Principal points declared 2 px too far right in all cameras move events back by 2 px (1 - ratio) against both."""
    moved_px = -2.0 * (1 - RATIO)
    pairs = [pair("depth", "rgb", 0.0), pair("rgb", "events", moved_px), pair("depth", "events", moved_px)]
    (centre,) = (h for h in shift_hypotheses(pairs, CAMERAS) if h.cause == "intrinsics_centre")
    assert centre.magnitude == pytest.approx(2.0)
