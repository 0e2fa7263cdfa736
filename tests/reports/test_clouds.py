"""Event clouds in the report: every event in its place and colour, small, and nothing where arrays do not fit."""

import base64
import json
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.evidence.options import EvidenceOptions
from fedora_reports.clouds import CloudView, EventCloud, event_clouds_of
from fedora_reports.evidence import Evidence
from tests.reports.drawn_dots import dots_of
from tests.reports.evidence_samples import event_clouds

MOST_BYTES = 60_000


def drawn(**changed: NDArray[Any]) -> tuple[EventCloud, ...]:
    """The clouds of the samples, some arrays of which are others."""
    arrays = event_clouds() | {f"event_clouds/{name}": array for name, array in changed.items()}
    return event_clouds_of(Evidence(arrays, {}))


def test_every_event_is_drawn_in_its_colour() -> None:
    """54 events at places of their own: those of each polarity, and none twice."""
    first, second = drawn()
    assert len(dots_of(first.view, 'class="brighter"')) == len(dots_of(first.view, 'class="darker"')) == 27
    assert len(dots_of(second.view, 'class="brighter"') | dots_of(second.view, 'class="darker"')) == 27


def test_events_lie_where_the_projection_puts_them() -> None:
    """The last events in the last column are the rightmost; that of the upper row lies above that of the lower one."""
    (first,) = drawn(
        offsets_us=np.array([10_000, 10_000, -10_000], np.int16),
        x=np.array([9, 9, 0], np.uint16),
        y=np.array([0, 6, 3], np.uint16),
        polarities=np.array([1, 0, 1], np.uint8),
        instant=np.zeros(3, np.uint8),
    )
    (upper, left), (lower,) = (
        sorted(dots_of(first.view, 'class="brighter"'), reverse=True),
        dots_of(first.view, 'class="darker"'),
    )
    assert upper[0] == lower[0] > left[0]
    assert upper[1] < lower[1]


def test_axes_are_labelled_with_units() -> None:
    """Milliseconds from the instant on, pixels of the sensor, rows from above."""
    (first, _) = drawn()
    words = re.findall(r"<text[^>]*>([^<]*)</text>", first.view)
    assert {"t, ms", "x, px", "y, px", "-10", "10", "0"} <= set(words)
    assert first.caption == "54 of 70000 events within 20 ms; t is counted from 0.500 s"


def test_as_many_events_as_are_ever_kept_stay_small() -> None:
    """Noise, which has no two events at one place."""
    rng, count = np.random.default_rng(1), EvidenceOptions().cloud_events
    (cloud,) = drawn(
        instant=np.zeros(count, np.uint8),
        shapes_px=np.array([[720, 1280], [720, 1280]]),
        x=rng.integers(0, 1280, count).astype(np.uint16),
        y=rng.integers(0, 720, count).astype(np.uint16),
        offsets_us=rng.integers(-10_000, 10_000, count).astype(np.int16),
        polarities=rng.integers(0, 2, count).astype(np.uint8),
    )
    assert len(cloud.view.encode()) < MOST_BYTES


@pytest.mark.parametrize(
    "changed",
    [
        {"x": np.zeros(3, np.uint16)},
        {"times_us": np.zeros((2, 2))},
        {"shapes_px": np.array([[0, 9], [6, -1]])},
        {"intervals_us": np.full((2, 2), np.nan)},
        {"intervals_us": np.array([[1.0, 1.0], [1.0, 1.0]])},
        {"intervals_us": np.array([[-np.inf, np.inf], [-1.7e308, 1.7e308]])},
        {"counts": np.full(2, np.inf)},
        {"instant": np.full(81, 7, np.uint8)},
        {"polarities": np.array(["1"] * 81)},
    ],
)
def test_arrays_that_do_not_fit_draw_nothing(changed: dict[str, NDArray[Any]]) -> None:
    """Of other lengths, without a sensor, without a time, of no instant, or without numbers."""
    assert drawn(**changed) == ()


def test_scene_holds_every_event_once() -> None:
    """The points that a reader turns are those of the picture, to a 32767th of the box, each with its polarity."""
    first, _ = drawn()
    scene = json.loads(first.space)
    numbers = np.frombuffer(base64.b64decode(scene["cloud"]), "<i2").reshape(-1, 4)
    arrays = event_clouds()
    shares = (numbers[:, :3] / 32767 - scene["low"]) / np.subtract(scene["high"], scene["low"])
    offsets_us, x, y = (arrays[f"event_clouds/{name}"][:54].astype(float) for name in ("offsets_us", "x", "y"))
    expected = np.stack([(offsets_us + 10e3) / 20e3, x / 9, 1 - y / 6], axis=1)
    np.testing.assert_allclose(shares, expected, atol=2e-4)
    np.testing.assert_array_equal(numbers[:, 3], arrays["event_clouds/polarities"][:54])
    assert scene["paints"] == ["--darker", "--brighter"]
    assert {"t, ms", "x, px", "y, px"} <= {label[3] for label in scene["labels"]}


def test_projection_keeps_lengths() -> None:
    """Right, down and toward the eye are a rotation of the space."""
    axes = CloudView(0.6, 0.5).project(np.eye(3))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
