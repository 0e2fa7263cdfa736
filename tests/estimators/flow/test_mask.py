"""Masks: planes have no edges, edges are widened, occluded and departed points are left out."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.flow.mask import (
    BREAK_PX,
    compare_patterns,
    depth_range_m,
    edges,
    flow_breaks,
    flow_conflicts,
    inverse_depth,
    spread_at_targets,
)
from fedora_qa.estimators.flow.residual import TileGrid
from fedora_qa.estimators.flow.visibility import seen_in_both, seen_in_few_tiles
from fedora_qa.geometry.camera import RigidMotion

HEIGHT, WIDTH = 60, 80
FOCAL_PX = 70.0
K = np.array([[70.0, 0.0, 39.5], [0.0, 70.0, 29.5], [0.0, 0.0, 1.0]])
COLUMNS, ROWS = (a.astype(np.float32) for a in np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)))


def plane(normal: tuple[float, float, float] = (0.1, 0.9, 0.3), distance_m: float = 2.0) -> np.ndarray:
    rays = np.stack(((COLUMNS - 39.5) / 70, (ROWS - 29.5) / 70, np.ones_like(ROWS)), axis=-1)
    slopes = rays @ np.array(normal, dtype=np.float32)
    return np.divide(distance_m, slopes, out=np.full_like(slopes, np.nan), where=slopes > 0.05)


def inner(mask: np.ndarray) -> np.ndarray:
    return mask[5:-5, 5:-5]


def test_plane_has_no_edge_but_its_end() -> None:
    """Also at a grazing angle, inverse depth of a plane bends nowhere; the pixels without depth do count."""
    assert not inner(edges(inverse_depth(plane((0.1, 0.05, 1.0))), FOCAL_PX)).any()
    marked = edges(inverse_depth(plane()), FOCAL_PX)
    no_depth = ~np.isfinite(plane())
    assert marked[no_depth].all()
    assert not marked[35:-5, 5:-5].any()


def test_step_is_widened_by_four_pixels() -> None:
    """A nearer box marks 4 px on either side of the pixels at its edge, and no more."""
    depth = np.full((HEIGHT, WIDTH), 5.0, dtype=np.float32)
    depth[:, 40:] = 3.0
    marked = np.flatnonzero(inner(edges(inverse_depth(depth), FOCAL_PX))[20])
    assert (marked.min() + 5, marked.max() + 5) == (39 - 4, 40 + 4)


def test_grazed_ground_is_left_out() -> None:
    """Ground below a level camera: r rows below the horizon a footprint is f / r times as long as wide, at most 8."""
    height_m, horizon = 1.5, 9.5
    below = np.maximum(ROWS - horizon, 0.5)
    marked = edges((below / (FOCAL_PX * height_m)).astype(np.float32), FOCAL_PX)[:, 40]
    last = int(np.floor(horizon + FOCAL_PX / 8))  # 8.75 rows below the horizon
    assert marked[10 : last + 5].all()
    assert not marked[last + 5 : -5].any()


def seen(depth0: np.ndarray, depth1: np.ndarray, motion: RigidMotion, uncertainty_px: float = 0.0) -> np.ndarray:
    inverse0, inverse1 = inverse_depth(depth0), inverse_depth(depth1)
    no_edges, whole = np.zeros(inverse0.shape, np.uint8), np.zeros((1, 2), np.int64)
    first, second = (inverse0, no_edges), (inverse1, edges(inverse1, FOCAL_PX))
    return seen_in_both(K, motion, whole, inverse0.shape, first, second, uncertainty_px)[0]


def test_whole_plane_is_seen_from_where_the_camera_goes() -> None:
    """A sideways step of 0.2 m along a wall: all points that stay in view and off the border are seen."""
    wall = np.full((HEIGHT, WIDTH), 4.0, dtype=np.float32)
    visible = seen(wall, wall, RigidMotion(np.eye(3), np.array([-0.2, 0.0, 0.0])))
    assert visible[7:-7, 10:-7].all()
    assert not visible[:, :4].any()


def test_covered_strip_is_left_out() -> None:
    """A post in front of a wall moves 10 px over it: the strip that it covers is not seen in both."""
    wall0 = np.full((HEIGHT, WIDTH), 8.0, dtype=np.float32)
    wall1 = wall0.copy()
    wall0[:, 40:50], wall1[:, 26:36] = 1.0, 1.0  # 0.2 m to the left is 14 px at 1 m and 1.75 px at 8 m
    visible = seen(wall0, wall1, RigidMotion(np.eye(3), np.array([-0.2, 0.0, 0.0])))
    covered = slice(28, 36)  # wall pixels that end at 26.25 to 34.25, on the post
    assert not visible[10:-10, covered].any()
    assert visible[10:-10, 8:18].all()


@pytest.mark.parametrize(("uncertainty_px", "kept"), [(0.0, False), (2.0, True)])
def test_uncertain_motion_widens_the_tolerance_where_depth_slopes(uncertainty_px: float, kept: bool) -> None:
    """A motion that is off by a pixel rejects steep ground unless it is known to be uncertain."""
    ground = plane((0.0, 1.0, 0.2), 2.0)
    off = RigidMotion(Rotation.from_rotvec([1.5 / 70, 0.0, 0.0]).as_matrix(), np.zeros(3))
    visible = seen(ground, ground, off, uncertainty_px)
    assert bool(visible[35:40, 20:60].all()) is kept


def test_flow_tells_of_breaks_and_of_crowding() -> None:
    """Without depth: a break of the flow marks the first frame, the pixels where two flows meet the second."""
    flow = np.zeros((HEIGHT, WIDTH, 2), dtype=np.float32)
    flow[:, :40, 0] = 8.0
    breaks, crowded = flow_conflicts(flow)
    assert set(np.flatnonzero(inner(breaks)[20]) + 5) == set(range(35, 45))
    assert set(np.flatnonzero(inner(crowded)[20]) + 5) == set(range(36, 52))


def test_tiles_are_seen_as_the_whole_is_away_from_edges_of_the_first_frame() -> None:
    """Any tile of the image has what the image has at its place, but where the first frame has an edge."""
    inverse, motion = inverse_depth(plane((0.0, 0.1, 1.0))), RigidMotion(np.eye(3), np.array([-0.2, 0.1, 0.0]))
    edge, none = edges(inverse, FOCAL_PX), np.zeros(inverse.shape, np.uint8)
    whole = seen_in_both(K, motion, np.zeros((1, 2), np.int64), inverse.shape, (inverse, none), (inverse, edge), 0.0)[0]
    edge0 = none.copy()
    edge0[20:25, 30:50] = 1
    origins = np.array([[8, 4], [40, 21]])
    tiles = seen_in_both(K, motion, origins, (16, 32), (inverse, edge0), (inverse, edge), 0.0)
    for (left, top), tile in zip(origins, tiles, strict=True):
        part = np.s_[top : top + 16, left : left + 32]
        np.testing.assert_array_equal(tile, whole[part] & (edge0[part] == 0))
        assert 0 < np.count_nonzero(tile) < tile.size


def boxes(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Return a wavy depth with boxes before and behind it, some of them without a depth."""
    rows, columns = np.mgrid[:height, :width]
    depth = (4 + 3 * np.sin(columns / rng.uniform(20, 90)) * np.cos(rows / rng.uniform(20, 90))).astype(np.float32)
    for value in (1.5, 9.0, np.nan, 0.0, np.inf):
        left, top = rng.integers(0, width), rng.integers(0, height)
        depth[top : top + rng.integers(3, 60), left : left + rng.integers(3, 60)] = value
    return depth


@pytest.mark.parametrize("uncertainty_px", [0.0, 2.0])
@pytest.mark.parametrize("seed", range(12))
def test_parts_tell_what_maps_tell(seed: int, uncertainty_px: float) -> None:
    """To the bit, over all tiles of frames of any size, of one scene or two, seen by small and by wild motions."""
    rng = np.random.default_rng(seed)
    height, width = (int(size) for size in rng.integers(60, 300, 2))
    focal_px = rng.uniform(60, 300)
    camera = np.array([[focal_px, 0.3, width / 2], [0.0, 1.02 * focal_px, height / 2], [0.0, 0.0, 1.0]])
    depths_m = boxes(rng, height, width), boxes(np.random.default_rng(seed if seed % 2 else seed + 1), height, width)
    depths_m = depths_m if seed % 3 else (depths_m[0], depths_m[0])
    turn, shift_m = [(0.001, 0.01), (0.02, 0.2), (0.5, 4.0)][seed % 3]
    motion = RigidMotion(Rotation.from_rotvec(turn * rng.normal(size=3)).as_matrix(), shift_m * rng.normal(size=3))
    origins = TileGrid.of(height, width).origins
    maps = [(inverse, edges(inverse, focal_px)) for inverse in map(inverse_depth, depths_m)]
    expected = seen_in_both(camera, motion, origins, (32, 32), maps[0], maps[1], uncertainty_px)
    found = seen_in_few_tiles(camera, motion, origins, (32, 32), depths_m, uncertainty_px)
    np.testing.assert_array_equal(found, expected)
    shows_enough = np.count_nonzero(expected, axis=(1, 2)) >= 400
    found = seen_in_few_tiles(camera, motion, origins, (32, 32), depths_m, uncertainty_px, fewest=400)
    np.testing.assert_array_equal(found[shows_enough], expected[shows_enough])
    assert not np.any(found & ~expected)


def test_parts_tell_what_maps_tell_of_a_tile_that_is_torn_apart() -> None:
    """Half of it stays, the other half moves by 300 px both ways: what lies between the two is not looked at."""
    near = np.full((500, 500), 50.0, dtype=np.float32)
    near[:, :26] = 1.0
    after = near.copy()
    after[280:380, 250:400] = 1.0
    camera = np.array([[300.0, 0.0, 10.0], [0.0, 300.0, 10.0], [0.0, 0.0, 1.0]])
    motion, origins = RigidMotion(np.eye(3), np.array([1.0, 1.0, 0.0])), np.array([[10, 10]], dtype=np.int64)
    maps = [(inverse, edges(inverse, 300.0)) for inverse in map(inverse_depth, (near, after))]
    expected = seen_in_both(camera, motion, origins, (32, 32), maps[0], maps[1], 0.0)
    assert expected[0, :, :10].any()
    assert expected[0, :, 22:].any()
    found = seen_in_few_tiles(camera, motion, origins, (32, 32), (near, after), 0.0)
    np.testing.assert_array_equal(found, expected)


SHAPE = (4, 9)
NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-42, -2.5, 1.5, 40.0, 3e38])
MOSTLY_PLAIN = st.one_of(st.just(3.0), NUMBERS)


@settings(deadline=None)  # the first call compiles
@given(
    arrays(np.float32, (*SHAPE, 2), elements=MOSTLY_PLAIN, fill=st.just(3.0)),
    arrays(np.float32, SHAPE, elements=MOSTLY_PLAIN, fill=st.just(3.0)),
    arrays(np.bool_, SHAPE),
)
def test_counts_and_range_are_those_of_numpy(flow_px: np.ndarray, depth_m: np.ndarray, moving: np.ndarray) -> None:
    """Flow without depth, depth that stands without flow, infinite flow; least and largest depth that stands."""
    standing_m = np.where(moving, np.float32(np.nan), depth_m)
    present, valid = np.isfinite(flow_px).all(axis=-1), np.isfinite(depth_m) & (depth_m > 0)
    stands = valid & np.isfinite(standing_m)
    expected = (present & ~valid).sum(), (stands & ~present).sum(), np.isinf(flow_px).any(axis=-1).sum()
    assert compare_patterns(flow_px.reshape(SHAPE[0], -1), depth_m, standing_m) == expected
    found = depth_range_m(depth_m, standing_m)
    assert found == ((depth_m[stands].min(), depth_m[stands].max()) if stands.any() else None)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 6.0))
@settings(max_examples=30, deadline=None)
def test_spread_at_targets_is_the_variance_of_the_flows_that_lead_there(seed: int, spread_px: float) -> None:
    """For any flow, also with missing values and out of the frame: by NumPy, target by target."""
    rng = np.random.default_rng(seed)
    flow_px = rng.normal(0.0, spread_px, (9, 12, 2)).astype(np.float32)
    flow_px[rng.random((9, 12)) < 0.1] = np.nan
    leading: dict[tuple[int, int], list[np.ndarray]] = {}
    for row, column in np.argwhere(np.isfinite(flow_px).all(axis=-1)):
        u, v = flow_px[row, column].astype(np.float64)
        leading.setdefault((int(np.rint(row + v)), int(np.rint(column + u))), []).append(np.array([u, v]))
    expected = np.zeros((9, 12))
    for (row, column), flows in leading.items():
        if 0 <= row < len(expected) and 0 <= column < expected.shape[1]:
            expected[row, column] = np.var(flows, axis=0).max()
    np.testing.assert_allclose(spread_at_targets(flow_px), expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("shape", [(1, 1), (2, 5), (5, 2), (40, 60)])
def test_breaks_are_large_laplacians_missing_values_and_their_neighbours(shape: tuple[int, int]) -> None:
    """As OpenCV's Laplacian within the border, which counts as a break in a frame of any size."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    flow_px = np.stack([0.02 * columns**2 + 4 * (columns > 25), 0.03 * rows], axis=-1).astype(np.float32)
    flow_px[12:13, 20:22] = np.nan
    expected = np.zeros(shape, np.bool_)
    for component in np.moveaxis(flow_px, -1, 0):
        expected |= ~(np.abs(cv2.Laplacian(np.ascontiguousarray(component), cv2.CV_32F)) <= BREAK_PX)
    for side in (expected[0], expected[-1], expected[:, 0], expected[:, -1]):
        side[...] = True
    np.testing.assert_array_equal(flow_breaks(flow_px), expected)
    if shape == (40, 60):
        assert 0.05 < expected.mean() < 0.5
