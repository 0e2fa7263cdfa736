"""Conventions of flow, depth, colour frames and events."""

from collections.abc import Callable
from itertools import product
from typing import Final

import h5py
import numpy as np

from tests.benchmarks.conventions.convention import Array, Change, Convention, both, mapped, of_flow, rewrite, times

_RGB, _DEPTH = "path/rgb", "path/depth"
_FLOW_UNIT: Final = ("flow:flow_unit",)
_FLOW_GAIN: Final = ("flow:flow_gain", "flow:flow_unit")
_MIRRORED: Final = ("flow:mirrored",)
_FAR_MM: Final = 30_000.0


def _names_of_axes(u: int, v: int, exchanged: bool) -> tuple[str, ...]:
    if (u, v, exchanged) == (-1, -1, False):
        return ("flow:flow_sign",)
    return ("flow:frame_convention", "flow:axes_swapped")


def _in_axes(u: int, v: int, exchanged: bool) -> Callable[[Array, float], Array]:
    return lambda flow, _: (flow[..., ::-1] if exchanged else flow) * np.array([u, v])


def _sizes(flow: Array) -> Array:
    return np.array([flow.shape[2], flow.shape[1]])


FLOW: Final = {
    **{
        f"flow {'+' if u > 0 else '-'}u {'+' if v > 0 else '-'}v{', exchanged' if exchanged else ''}": Convention(
            _names_of_axes(u, v, exchanged), of_flow(_in_axes(u, v, exchanged))
        )
        for u, v, exchanged in product((1, -1), (1, -1), (False, True))
        if (u, v, exchanged) != (1, 1, False)
    },
    "flow fields mirrored": Convention(_MIRRORED, of_flow(lambda flow, _: flow[:, :, ::-1])),
    "flow mirrored with its vectors": Convention(_MIRRORED, of_flow(lambda flow, _: flow[:, :, ::-1] * [-1, 1])),
    "flow fields upside down": Convention(_MIRRORED, of_flow(lambda flow, _: flow[:, ::-1])),
    "flow upside down with its vectors": Convention(_MIRRORED, of_flow(lambda flow, _: flow[:, ::-1] * [1, -1])),
    "flow turned by half": Convention(
        (*_MIRRORED, "flow:frame_convention"), of_flow(lambda flow, _: -flow[:, ::-1, ::-1])
    ),
    "flow in px/s": Convention(_FLOW_UNIT, of_flow(lambda flow, hz: flow * hz)),
    "flow in px/ms": Convention(_FLOW_UNIT, of_flow(lambda flow, hz: flow * hz / 1000)),
    "flow in px s": Convention(_FLOW_UNIT, of_flow(lambda flow, hz: flow / hz)),
    "flow in widths and heights": Convention(_FLOW_UNIT, of_flow(lambda flow, _: flow / _sizes(flow))),
    "flow in clip space": Convention(_FLOW_UNIT, of_flow(lambda flow, _: 2 * flow / _sizes(flow))),
    "flow in 1/64 px": Convention(_FLOW_GAIN, of_flow(lambda flow, _: flow * 64)),
    "flow over 20": Convention(_FLOW_GAIN, of_flow(lambda flow, _: flow / 20)),
    "flow of half the size": Convention(_FLOW_GAIN, of_flow(lambda flow, _: flow / 2)),
    "flow of twice the size": Convention(_FLOW_GAIN, of_flow(lambda flow, _: flow * 2)),
    "flow of 1440 columns": Convention(_FLOW_GAIN, of_flow(lambda flow, _: flow * 1440 / flow.shape[2])),
    "flow of columns in another shape": Convention(_FLOW_GAIN, of_flow(lambda flow, _: flow * [4 / 3, 1])),
    "flow to the frame before": Convention(
        ("flow:flow_sign", "flow:flow_interval_shifted"),
        of_flow(lambda flow, _: np.concatenate([np.full_like(flow[:1], np.nan), -flow[:-1]])),
    ),
    "flow of the next interval": Convention(
        ("flow:flow_interval_shifted",), of_flow(lambda flow, _: np.concatenate([flow[1:], flow[-1:]]))
    ),
    "flow with 0 for none": Convention(("flow:invalid_encoding",), of_flow(lambda flow, _: np.nan_to_num(flow))),
    "flow with 1e9 for none": Convention(
        ("flow:invalid_encoding",), of_flow(lambda flow, _: np.nan_to_num(flow, nan=1e9))
    ),
}


def _of_depth(by: Callable[[Array], Array]) -> Change:
    return mapped(_DEPTH, by=by)


def _along_rays(power: int) -> Change:
    def change(file: h5py.File) -> None:
        K, depth = file["metadata/cameras/depth"].attrs["K"], file[_DEPTH][()]
        rows, columns = np.mgrid[: depth.shape[1], : depth.shape[2]]
        slopes = (columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1]
        rewrite(file, _DEPTH, depth * np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2) ** power)

    return change


DEPTH: Final = {
    **{
        f"depth times {factor:g}": Convention(("depth:unit_mm_m",), _of_depth(times(factor)))
        for factor in (0.001, 0.01, 0.1, 0.3048, 4.0, 10.0, 1000.0)
    },
    "depth as 255 shares of its range": Convention(("depth:unit_mm_m",), _of_depth(times(255 / _FAR_MM))),
    "inverse depth": Convention(
        ("depth:unit_mm_m", "depth:invalid_encoding", "depth:depth_ray_not_z"), _of_depth(lambda depth: 1e6 / depth)
    ),
    "depth along rays": Convention(("depth:depth_ray_not_z",), _along_rays(1)),
    "depth taken for rays": Convention(("depth:depth_ray_not_z",), _along_rays(-1)),
    "depth mirrored": Convention(("depth:mirrored",), _of_depth(lambda depth: depth[:, :, ::-1])),
    "depth upside down": Convention(("depth:mirrored",), _of_depth(lambda depth: depth[:, ::-1])),
    "depth with 0 for none": Convention(("depth:invalid_encoding",), _of_depth(np.nan_to_num)),
    "depth with 65535 for none": Convention(
        ("depth:invalid_encoding",), _of_depth(lambda depth: np.nan_to_num(depth, nan=65_535.0))
    ),
    "depth late by a frame": Convention(
        ("depth:time_offset",), _of_depth(lambda depth: np.concatenate([depth[:1], depth[:-1]]))
    ),
    "depth early by a frame": Convention(
        ("depth:time_offset",), _of_depth(lambda depth: np.concatenate([depth[1:], depth[-1:]]))
    ),
}


def _of_frames(by: Callable[[Array], Array]) -> Change:
    return mapped(_RGB, by=lambda frames: np.rint(by(frames.astype(np.float64))).clip(0, 255))


def _in_order(order: list[int]) -> Callable[[Array], Array]:
    return lambda frames: frames[..., order]


COLOUR: Final = {
    **{
        f"colour {name}": Convention(("rgb:channel_order",), _of_frames(_in_order(order)))
        for name, order in (("BGR", [2, 1, 0]), ("GBR", [1, 2, 0]), ("GRB", [1, 0, 2]))
    },
    "colour mirrored": Convention(("rgb:mirrored",), _of_frames(lambda frames: frames[:, :, ::-1])),
    "colour upside down": Convention(("rgb:mirrored",), _of_frames(lambda frames: frames[:, ::-1])),
    "colour turned by half": Convention(("rgb:mirrored",), _of_frames(lambda frames: frames[:, ::-1, ::-1])),
    "colour with a gamma": Convention(
        ("rgb:exposure_or_gamma",), _of_frames(lambda frames: 255 * (frames / 255) ** (1 / 2.2))
    ),
    "colour with its gamma undone twice": Convention(
        ("rgb:exposure_or_gamma",), _of_frames(lambda frames: 255 * (frames / 255) ** 2.2)
    ),
    "colour late by a frame": Convention(
        ("rgb:time_offset",), _of_frames(lambda frames: np.concatenate([frames[:1], frames[:-1]]))
    ),
    "colour early by a frame": Convention(
        ("rgb:time_offset",), _of_frames(lambda frames: np.concatenate([frames[1:], frames[-1:]]))
    ),
    "colour one pixel to the right": Convention(
        ("rgb:spatial_offset",), _of_frames(lambda frames: np.roll(frames, 1, 2))
    ),
}


def _from_end(axis: str, side: str) -> Change:
    def change(file: h5py.File) -> None:
        key, size = f"path/events/{axis}", int(file["metadata/cameras/events"].attrs[side])
        rewrite(file, key, size - 1 - file[key][()].astype(np.int64))

    return change


def _exchanged(file: h5py.File) -> None:
    columns, rows = file["path/events/x"][()], file["path/events/y"][()]
    rewrite(file, "path/events/x", rows)
    rewrite(file, "path/events/y", columns)


_MIRRORED_X, _MIRRORED_Y = _from_end("x", "width"), _from_end("y", "height")

EVENTS: Final = {
    "polarity 0 brighter": Convention(
        ("events:polarity_inverted",), mapped("path/events/p", by=lambda polarity: 1 - polarity)
    ),
    "events mirrored": Convention(("events:mirrored",), _MIRRORED_X),
    "events upside down": Convention(("events:mirrored",), _MIRRORED_Y),
    "events turned by half": Convention(("events:mirrored",), both(_MIRRORED_X, _MIRRORED_Y)),
    "events y, x": Convention(("events:axes_swapped",), _exchanged),
    "events counted from 1": Convention(
        ("events:spatial_offset",), mapped("path/events/x", "path/events/y", by=lambda places: places + 1)
    ),
}
