"""Evidence of an imaginary sequence, in the shapes that the record promises."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

MOMENTS = 3


def moments() -> dict[str, NDArray[Any]]:
    """Three moments of a 12 x 8 picture, in which depth and flow lack a corner and the last flow is missing."""
    rng = np.random.default_rng(7)
    times_us = np.array([0.0, 500e3, 1e6])
    depth_m = rng.uniform(2.0, 20.0, (MOMENTS, 8, 12)).astype(np.float32)
    flow_px = rng.normal(0.0, 3.0, (MOMENTS, 8, 12, 2)).astype(np.float32)
    depth_m[:, 0, 0] = flow_px[:, 0, 0] = flow_px[-1] = np.nan
    return {
        "moments/times_us": times_us,
        "moments/rgb": rng.integers(0, 256, (MOMENTS, 8, 12, 3)).astype(np.uint8),
        "moments/depth_m": depth_m,
        "moments/flow_px": flow_px,
        "moments/flow_interval_us": np.stack([times_us, times_us + 20e3], axis=1),
        "moments/residual_dn": rng.normal(0.0, 20.0, (MOMENTS, 8, 12)).astype(np.float16),
        "moments/brighter": rng.integers(0, 4, (MOMENTS, 6, 9)).astype(np.uint16),
        "moments/darker": rng.integers(0, 4, (MOMENTS, 6, 9)).astype(np.uint16),
        "moments/events_interval_us": np.stack([times_us - 10e3, times_us + 10e3], axis=1),
    }


def place(finding: str) -> dict[str, NDArray[Any]]:
    """The pictures of a finding: the second moment, with a box in its upper left quarter."""
    arrays = {name.replace("moments", f"places/{finding}"): array[1] for name, array in moments().items()}
    return arrays | {f"places/{finding}/box": np.array([0.0, 0.0, 0.5, 0.5])}


def beside(finding: str) -> dict[str, NDArray[Any]]:
    """The frames before and after a place: the first and the last moment."""
    return {
        name.replace("moments", f"places/{finding}/{group}"): array[k]
        for group, k in (("before", 0), ("after", 2))
        for name, array in moments().items()
    }


def trial(diagnosis: str) -> dict[str, NDArray[Any]]:
    """A fault that was undone: other events over the same frame, two deviations, a series and a map of checks."""
    group = f"trials/{diagnosis}"
    before = {name.replace("moments", f"{group}/before"): array[1] for name, array in moments().items()}
    after = {name.replace("before/", "after/"): array for name, array in before.items()}
    after[f"{group}/after/darker"] = before[f"{group}/before/brighter"]
    times_s = np.arange(5.0)
    return {
        f"{group}/deviations/event_response.timing/time_offset": np.array([[3.0, 0.3], [0.03, 0.3]]),
        f"{group}/deviations/event_response.timing/late_region": np.array([[0.6, 0.3], [np.nan, np.nan]]),
        f"{group}/deviations/event_stream.gaps/gaps": np.array([[4.0, 0.0], [0.0, 0.0]]),
        f"{group}/size": np.array([[0.0, 10.0], [1.5, 5.0], [3.0, 0.1], [4.5, 5.0], [6.0, 10.0]]),
        **before,
        **after,
        f"{group}/before/imu.rotation/residual": np.stack([times_s, times_s], axis=1),
        f"{group}/after/imu.rotation/residual": np.stack([times_s, 0.1 * times_s], axis=1),
        f"{group}/before/event_response.conservation/violations": np.ones((4, 6)),
        f"{group}/after/event_response.conservation/violations": np.zeros((4, 6)),
        f"{group}/box": np.array([0.25, 0.25, 0.75, 0.75]),
    }


def event_clouds() -> dict[str, NDArray[Any]]:
    """Two clouds of an edge that crosses a sensor of 9 x 6; the second has half of the events of the first."""
    x, y = (values.ravel() for values in np.meshgrid(np.arange(9), np.arange(6)))
    count = len(x)
    times_us = np.array([500e3, 1e6])
    return {
        "event_clouds/times_us": times_us,
        "event_clouds/intervals_us": times_us[:, None] + [-10e3, 10e3],
        "event_clouds/counts": np.array([70_000, count // 2]),
        "event_clouds/shapes_px": np.array([[6, 9], [6, 9]]),
        "event_clouds/instant": np.repeat([0, 1], [count, count // 2]).astype(np.uint8),
        "event_clouds/x": np.concatenate([x, x[::2]]).astype(np.uint16),
        "event_clouds/y": np.concatenate([y, y[::2]]).astype(np.uint16),
        "event_clouds/offsets_us": np.concatenate([x, x[::2]]).astype(np.int16) * 2000 - 8000,
        "event_clouds/polarities": (np.arange(count + count // 2) % 2).astype(np.uint8),
    }


def point_cloud() -> dict[str, NDArray[Any]]:
    """A coloured wall that two frames show, 12 m north of a far origin, and a point far beyond it."""
    east_m, up_m = (values.ravel() for values in np.meshgrid(np.linspace(-6.0, 6.0, 13), np.linspace(0.0, 4.0, 9)))
    wall_m = np.stack([east_m, np.full(len(east_m), 12.0), up_m], axis=1)
    offsets_m = np.concatenate([wall_m, wall_m, [[0.0, 900.0, 0.0]]])
    rgb = np.tile(np.array([120, 60, 30], np.uint8), (len(offsets_m), 1))
    return {
        "point_cloud/times_us": np.array([0.0, 1e6]),
        "point_cloud/origin_world_m": np.array([5e6, 0.0, 0.0]),
        "point_cloud/offsets_m": offsets_m.astype(np.float32),
        "point_cloud/rgb": rgb,
    }


def frusta(centre_world_m: NDArray[Any] | None = None) -> dict[str, NDArray[Any]]:
    """Two views to the north of a camera that sees 90 x 60 degrees or so, the second of them rolled upside down."""
    right, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.6])
    corners = np.array([up - right, up + right, right - up, -up - right]) + np.array([0.0, 1.0, 0.0])
    centre = np.array([5e6, 6.0, 2.0]) if centre_world_m is None else centre_world_m
    return {
        "frusta/rgb/times_us": np.array([0.0, 1e6]),
        "frusta/rgb/centres_world_m": np.tile(centre, (2, 1)),
        "frusta/rgb/rays_world": np.stack([corners, np.roll(corners, 2, axis=0)]),
    }


def distributions() -> dict[str, NDArray[Any]]:
    """Times between events of a pixel, in two blocks; one of them shorter than what a logarithm can show."""
    edges = np.array([0.0, 1.0, 2.0, 4.0, 8.0])
    return {
        "distributions/pixel_interval_ms/edges": edges,
        "distributions/pixel_interval_ms/counts": np.array([[1, 0, 2, 1], [0, 4, 2, 3]]),
    }


def timeline() -> dict[str, NDArray[Any]]:
    """Two streams in ten bins over two seconds; frames are missing in the fourth."""
    frames = np.full(10, 10)
    frames[3] = 0
    return {
        "timeline/edges_us": np.linspace(0.0, 2e6, 11),
        "timeline/events": np.arange(10) * 100,
        "timeline/rgb": frames,
    }


def histograms() -> dict[str, NDArray[Any]]:
    """One histogram of depth whose bins grow."""
    return {"histograms/depth_m/edges": np.geomspace(0.5, 32.0, 7), "histograms/depth_m/counts": np.arange(6)}


def all_kinds() -> dict[str, NDArray[Any]]:
    """Everything but a path, which needs graphics."""
    series = np.array([[0.0, 1.0], [1.0, np.nan], [2.0, 3.0]])
    return {
        **moments(),
        **event_clouds(),
        **place("F1"),
        **beside("F1"),
        **trial("D1"),
        "agreement/events/rgb": np.array([3, 1]),
        "agreement/depth/rgb": np.array([2, 0]),
        **distributions(),
        **timeline(),
        **histograms(),
        "event_response.timing/offset": series,
        "event_response.timing/map": np.array([[-1.0, 0.0], [np.nan, 2.0]]),
        "offset_by_frame": np.arange(5.0),
    }
