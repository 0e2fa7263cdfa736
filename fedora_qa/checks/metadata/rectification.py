"""A map that rectifies events, compared with the declared cameras, and the rule that gives a wrong one."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.features import Feature
from fedora_qa.geometry.lens import pixels_of_rays, rays_of_pixels
from fedora_qa.geometry.pinhole_fit import fit_pinhole
from fedora_qa.geometry.so3 import log
from fedora_qa.sequence.declared import Camera, Lens

Float64 = NDArray[np.float64]

_RULE_QUANTILE: Final = 0.9
_RULE_RATIO: Final = 0.01
"""A rule is named if the distance of the entries from it, at nine tenths of the pixels, is a hundredth of that from the
declared cameras at most: the rule then explains 99% of the deviation."""

Rule = Literal[
    "exchanged_coordinates",
    "exchanged_pixels",
    "pixels_themselves",
    "without_lens",
    "other_view",
    "twice",
    "inverse",
    "other_pinhole",
    "none",
]


@dataclass(frozen=True, slots=True)
class RectificationRule(Feature):
    """The rule that gives the entries of a map that rectifies events.

    Attributes
    ----------
    rule
        ``none`` where no common rule does.
    """

    rule: Rule


@dataclass(frozen=True, slots=True)
class RectificationError:
    """The difference of a map from the positions that follow from the cameras.

    Attributes
    ----------
    undefined
        Pixels that have a position in one of both only.
    distance_px
        (H, W) distances; 0 where either has no position.
    rule, text
        The rule that gives the entries, and the same in words; None and empty where they are right to their rounding.
    rounding_px
        Of an entry, which is stored in float32.
    """

    undefined: int
    distance_px: Float64
    rounding_px: float
    rule: RectificationRule | None
    text: str


def rectification_error(
    map_px: NDArray[np.float32], events: Camera, view: Camera, other_view: Camera | None
) -> RectificationError:
    """Compare a map with the positions that follow from the cameras.

    Parameters
    ----------
    map_px
        (H, W, 2) x and y, px, in the view, of each pixel of the event camera.
    events, view
        The event camera, and the camera whose view the map leads to.
    other_view
        Another camera, whose view it may lead to by mistake.
    """
    height, width = map_px.shape[:2]
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    expected_px = _positions_px(events, events.lens, view, columns, rows)
    defined, expected = np.isfinite(map_px).all(axis=-1), np.isfinite(expected_px).all(axis=-1)
    both = defined & expected
    distance_px = np.where(both, _distance_px(map_px, expected_px), 0.0)
    # Both coordinates are rounded to float32, by half a unit in the last place each.
    rounding_px = float(np.spacing(np.abs(map_px[both]).max())) if np.any(both) else 0.0
    rule, text = None, ""
    if distance_px.max(initial=0.0) > rounding_px:
        rule, text = RectificationRule("none"), "no common rule gives these entries"
        most_px = _RULE_RATIO * float(np.quantile(distance_px[both], _RULE_QUANTILE))
        for name, words, positions_px in _wrong_maps(map_px, expected_px, events, view, other_view):
            compared = defined & np.isfinite(positions_px).all(axis=-1)
            # A rule that is defined for few pixels says nothing about the others.
            if np.count_nonzero(compared) < _RULE_QUANTILE * np.count_nonzero(defined):
                continue
            if np.quantile(_distance_px(map_px, positions_px)[compared], _RULE_QUANTILE) <= most_px:
                rule, text = RectificationRule(name), words
                break
    return RectificationError(int(np.count_nonzero(defined != expected)), distance_px, rounding_px, rule, text)


def _wrong_maps(
    map_px: NDArray[np.float32], expected_px: Float64, events: Camera, view: Camera, other_view: Camera | None
) -> Iterator[tuple[Rule, str, Float64]]:
    """Yield rules, in words and as the entries (H, W, 2), px, that they give; those without a fit come first."""
    height, width = expected_px.shape[:2]
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    yield "exchanged_coordinates", "its entries are y before x", expected_px[..., ::-1]
    if height == width:
        yield "exchanged_pixels", "it is stored by x before y", expected_px.swapaxes(0, 1)
    yield "pixels_themselves", "its entries are the pixels themselves, not rectified", np.dstack((columns, rows))
    if events.lens is not None:
        without = _positions_px(events, None, view, columns, rows)
        yield "without_lens", "it leaves the distortion of the event camera out", without
    if other_view is not None:
        yield "other_view", "it leads to the view of rgb", _positions_px(events, events.lens, other_view, columns, rows)
    twice = _positions_px(events, events.lens, view, expected_px[..., 0], expected_px[..., 1])
    yield "twice", "the rectification is applied twice", twice
    inverse = _positions_px(view, view.lens, events, columns, rows)
    yield "inverse", "it leads from the view to the event camera", inverse
    x, y = rays_of_pixels(events.K, events.lens, columns, rows)
    fit = fit_pinhole(x, y, map_px.astype(np.float64), view.K)
    if fit is not None:
        R_view_events = view.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
        angle_deg = np.degrees(np.linalg.norm(log(fit.R @ R_view_events.T)))
        longer = 100 * (fit.K[0, 0] / view.K[0, 0] - 1)
        right_px, down_px = fit.K[:2, 2] - view.K[:2, 2]
        yield (
            "other_pinhole",
            f"it fits a view with {longer:+.3g}% of focal length, a principal point {right_px:+.3g}, {down_px:+.3g} px "
            f"away, turned by {angle_deg:.3g} degrees",
            fit.positions_px(x, y),
        )


def _positions_px(
    camera: Camera, lens: Lens | None, view: Camera, columns: NDArray[Any], rows: NDArray[Any]
) -> Float64:
    """Return where a view with the same centre images the rays of a camera's pixels, (..., 2) px; NaN where nowhere."""
    x, y = rays_of_pixels(camera.K, lens, columns, rows)
    # A direction of the camera in the axes of the view: R_view_camera = R_body_view^T R_body_camera.
    R_view_camera = view.T_body_camera[:3, :3].T @ camera.T_body_camera[:3, :3]
    ahead_x, ahead_y, ahead = R_view_camera @ np.stack([x, y, np.ones_like(x)]).reshape(3, -1)
    ahead[~(ahead > 0)] = np.nan
    positions_px = np.stack(pixels_of_rays(view.K, view.lens, ahead_x / ahead, ahead_y / ahead), axis=-1)
    return positions_px.reshape(*x.shape, 2)


def _distance_px(one_px: NDArray[Any], other_px: NDArray[Any]) -> Float64:
    return np.asarray(np.linalg.norm(one_px - other_px, axis=-1), dtype=np.float64)
