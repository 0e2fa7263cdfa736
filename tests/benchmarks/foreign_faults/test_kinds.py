"""Single kinds of foreign faults: what they plant is what their pipelines do."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign_faults.displacement import KEYS, recomputed
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.sources import Source
from tests.benchmarks.foreign_faults.table import KINDS
from tests.support.contents import Contents


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("colour stamped when received", "path/rgb_ts"),
        ("events on another epoch", "path/events/t"),
        ("IMU delayed by its filter", "path/imu/ts"),
        ("flow stamped when computed", "path/flow/25hz_ts"),
    ],
)
def test_stamps_are_late_by_the_size(
    name: str, key: str, pair_of: Callable[[str], tuple[Contents, Contents, Plan]]
) -> None:
    """To half a microsecond, all of them."""
    old, new, plan = pair_of(name)
    np.testing.assert_allclose(new[key] - old[key], 1000 * plan.size, rtol=0, atol=0.5)


@pytest.mark.parametrize(
    "name",
    [kind.name for kind in KINDS if "metadata/rgb_to_event" in kind.alters and "_to_event:" not in "".join(kind.truth)
     and "map" not in kind.name],
)  # fmt: skip
def test_maps_follow_the_stamps(name: str, pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Where a pipeline makes them of the stamps that it has: the count of events before each frame."""
    _, new, _ = pair_of(name)
    events_us = new["path/events/t"]
    for stream in ("rgb", "depth"):
        counts = [int(np.sum(events_us < frame_us)) for frame_us in new[f"path/{stream}_ts"]]
        assert new[f"metadata/{stream}_to_event"].tolist() == counts


def test_equal_stamps_are_counted(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Entries are the events that are not after their frame, and some are at its time."""
    _, new, _ = pair_of("maps behind equal stamps")
    counts = [int(np.sum(new["path/events/t"] <= frame_us)) for frame_us in new["path/rgb_ts"]]
    assert new["metadata/rgb_to_event"].tolist() == counts
    assert counts != [int(np.sum(new["path/events/t"] < frame_us)) for frame_us in new["path/rgb_ts"]]


def test_local_faults_leave_the_rest(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Rows that differ lie in one interval, no longer than the plan's."""
    for name, key in {
        "gyro bias for a while": "path/imu/angular_velocity",
        "exposure jumps": "path/rgb",
        "colour of another sequence for a while": "path/rgb",
        "colour mirrored for a while": "path/rgb",
        "depth along rays for a while": "path/depth",
        "flow axes exchanged for a while": "path/flow/50hz",
        "gyro in deg/s for a while": "path/imu/angular_velocity",
        "positions elsewhere for a while": "path/pose/position",
    }.items():
        old, new, plan = pair_of(name)
        old_values, new_values = np.nan_to_num(old[key]), np.nan_to_num(new[key])
        differ = np.flatnonzero((old_values != new_values).reshape(len(old_values), -1).any(axis=1))
        assert np.all(np.diff(differ) == 1)
        assert len(differ) == pytest.approx((plan.end - plan.begin) * len(old[key]), abs=1.5)


def test_flow_is_recomputed_as_the_format_defines_it(clean_of: Callable[[Source], Path]) -> None:
    """What planters of flow change in one respect is the clean file's flow, to single precision."""
    with h5py.File(clean_of(Source("park-day", 0))) as file:
        for key, values in recomputed(file).items():
            np.testing.assert_allclose(values, file[key][...], rtol=1e-5, atol=1e-5)


def test_backward_flow_leads_back(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Where flow carries a pixel, backward flow leads to where it came from, but where depth jumps."""
    old, new, _ = pair_of("backward flow")
    key = KEYS[-1]
    forward, backward = old[key][3].astype(np.float64), new[key][3].astype(np.float64)
    rows, columns = np.indices(forward.shape[:2])
    at = np.nan_to_num(np.rint(np.stack([rows + forward[..., 1], columns + forward[..., 0]]))).astype(int)
    at[0], at[1] = np.clip(at[0], 0, rows.max()), np.clip(at[1], 0, columns.max())
    back = np.linalg.norm(forward + backward[at[0], at[1]], axis=-1)
    assert np.nanmedian(back) < 0.02 * np.nanmedian(np.linalg.norm(forward, axis=-1)) + 0.01


def test_events_between_frames_sum_to_the_frames(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Events of a pixel times the threshold give the change of its log luma, to less than a threshold."""
    _, new, _ = pair_of("events between the frames")
    shape = (int(new["metadata/cameras/events@height"]), int(new["metadata/cameras/events@width"]))
    threshold = new["metadata/events@threshold_on"]
    total = np.zeros(shape)
    np.add.at(total, (new["path/events/y"], new["path/events/x"]), np.where(new["path/events/p"] == 1, 1.0, -1.0))
    # The frames' size is not a whole multiple of the sensor's: nearest pixels bound the change loosely.
    luma = np.log(np.maximum(new["path/rgb"][[0, -1]].astype(float) @ [0.299, 0.587, 0.114], 1.0))
    change = luma[1] - luma[0]
    columns = np.clip(np.rint((np.arange(shape[1]) + 0.5) * change.shape[1] / shape[1] - 0.5).astype(int), 0, None)
    rows = np.clip(np.rint((np.arange(shape[0]) + 0.5) * change.shape[0] / shape[0] - 0.5).astype(int), 0, None)
    nearest = change[np.minimum(rows, change.shape[0] - 1)][:, np.minimum(columns, change.shape[1] - 1)]
    assert np.median(np.abs(total * threshold - nearest)) < threshold
    assert np.corrcoef(total.ravel(), nearest.ravel())[0, 1] > 0.8


@pytest.mark.parametrize(("name", "factor"), [("gravity removed", -1.0), ("gravity with the other sign", -2.0)])
def test_gravity_changes_along_the_vertical(
    name: str, factor: float, pair_of: Callable[[str], tuple[Contents, Contents, Plan]]
) -> None:
    """In the world, specific force differs by a multiple of gravity along Z alone."""
    old, new, _ = pair_of(name)
    key = "path/imu/linear_acceleration"
    rows = np.searchsorted(old["path/imu/ts"], old["path/pose/ts"])
    attitude = Rotation.from_quat(old["path/pose/orientation"])
    gravity = factor * old["metadata/imu@gravity"]
    np.testing.assert_allclose(
        attitude.apply((new[key] - old[key])[rows]), np.tile([0, 0, gravity], (len(rows), 1)), rtol=0, atol=1e-9
    )


def test_poses_of_a_lower_rate_are_straight(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Second differences vanish but where a pose of the lower rate lies."""
    _, new, plan = pair_of("pose from a lower rate")
    bends = np.linalg.norm(np.diff(new["path/pose/position"], 2, axis=0), axis=1) > 1e-10
    # 200 Hz in the file: a bend for each of the lower rate's poses within.
    assert np.sum(bends) == pytest.approx(0.4 * plan.size, abs=2)


def test_ned_is_a_rotation_of_both_frames(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Forward in ENU, east and north exchanged, up turned to down; the body's forward stays forward."""
    old, new, _ = pair_of("pose in NED")
    before, after = (Rotation.from_quat(contents["path/pose/orientation"]) for contents in (old, new))
    east, north, up = before.apply([1.0, 0.0, 0.0]).T
    np.testing.assert_allclose(after.apply([1.0, 0.0, 0.0]), np.stack([north, east, -up], axis=1), atol=1e-12)
    np.testing.assert_allclose(new["path/pose/position"], old["path/pose/position"][:, [1, 0, 2]] * [1, 1, -1])


def test_saturation_loses_the_last_events_of_full_milliseconds(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """No millisecond has more than the limit; those below it have all of theirs; no more is lost than stated."""
    old, new, plan = pair_of("readout saturates")
    before, after = (
        np.bincount((contents["path/events/t"] - old["path/events/t"][0]) // 1000, minlength=401)
        for contents in (old, new)
    )
    np.testing.assert_array_equal(after, np.minimum(before, after.max()))
    assert 0 < 1 - after.sum() / before.sum() <= plan.size / 100


def test_kitti_keeps_vectors_to_half_a_step(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """A step is 1/64 px; what is not valid is -512 px."""
    old, new, _ = pair_of("flow through the 16 bits of KITTI")
    for key in KEYS:
        valid = np.isfinite(old[key])
        assert np.abs(new[key] - old[key])[valid].max() <= 1 / 128 + 1e-5
        assert not valid.all()
        np.testing.assert_array_equal(new[key][~valid], -512)


def test_a_slewed_clock_stays_ahead(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """By the gain times the length of the while; before it the clock is right."""
    old, new, plan = pair_of("IMU clock slewed for a while")
    ahead_us = new["path/imu/ts"] - old["path/imu/ts"]
    span_us = old["path/imu/ts"][-1] - old["path/imu/ts"][0]
    assert ahead_us[0] == 0
    assert ahead_us[-1] == pytest.approx(plan.size / 1e6 * (plan.end - plan.begin) * span_us, abs=1)


def test_the_other_eye_sees_near_pixels_farther_left(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """Each depth of a row is one of the same row, at the column that its parallax gives, to half a pixel."""
    old, new, plan = pair_of("depth of the other eye")
    focal = old["metadata/cameras/depth@K"][0, 0]
    row, view = old["path/depth"][0][-1], new["path/depth"][0][-1]
    columns = np.flatnonzero(np.isfinite(view))
    assert len(columns) > 0
    for column in columns:
        sources = np.flatnonzero(row == view[column])
        assert np.min(np.abs(sources - focal * 1000 * plan.size / view[column] - column)) <= 0.5 + 1e-6


def test_encoded_frames_need_more_light_for_an_event(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """A pixel's events times the power of encoding give its change of light, to less than an event."""
    old, new, _ = pair_of("events of encoded frames")
    shape = (int(old["metadata/cameras/events@height"]), int(old["metadata/cameras/events@width"]))
    totals = []
    for contents in (old, new):
        total = np.zeros(shape)
        signs = np.where(contents["path/events/p"] == 1, 1.0, -1.0)
        np.add.at(total, (contents["path/events/y"], contents["path/events/x"]), signs)
        totals.append(total)
    assert np.abs(totals[0] - 2.2 * totals[1]).max() < 2.2
    assert len(new["path/events/t"]) < 0.6 * len(old["path/events/t"])


def test_a_low_pass_is_late_by_its_constant(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Behind the start, less half a period: the positions of a steady motion."""
    old, new, plan = pair_of("pose behind a low-pass")
    along = old["path/pose/position"][-1] - old["path/pose/position"][0]
    before, after = (contents["path/pose/position"] @ along for contents in (old, new))
    late_us = old["path/pose/ts"][-1] - np.interp(after[-1], before, old["path/pose/ts"])
    assert late_us == pytest.approx(1000 * plan.size, rel=0.25)


def test_late_poses_give_the_flow_of_an_earlier_interval(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """Fields of late poses lie between those of their own interval and of earlier ones, and none is without motion."""
    old, new, _ = pair_of("flow from late poses")
    before, after = (np.nanmean(np.abs(contents[KEYS[-1]]), axis=(1, 2, 3)) for contents in (old, new))
    assert np.all(after > 0.5 * before.min())
    np.testing.assert_array_equal(np.isnan(new[KEYS[0]]), np.isnan(old[KEYS[0]]))


def test_the_right_eye_sees_a_point_farther_left(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """By f b / z: where depth is even, the frame is the old one, moved."""
    old, new, plan = pair_of("colour of the right eye")
    disparity = old["metadata/cameras/rgb@K"][0, 0] * 1000 * plan.size / old["path/depth"][0]
    luma = [contents["path/rgb"][0].astype(float).mean(axis=-1) for contents in (old, new)]
    rows, columns = np.nonzero(np.isfinite(disparity) & (disparity < np.arange(disparity.shape[1])))
    at = columns - disparity[rows, columns]
    left = np.clip(np.floor(at).astype(int), 0, disparity.shape[1] - 2)
    seen = luma[1][rows, left] * (1 - at + left) + luma[1][rows, left + 1] * (at - left)
    errors = np.abs(seen - luma[0][rows, columns])
    assert np.median(errors) < 0.3 * np.median(np.abs(luma[1] - luma[0])[rows, columns])


def test_angles_without_halves_are_twice_as_large(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """About the same axis."""
    old, new, _ = pair_of("angles of quaternions not halved")
    before, after = (Rotation.from_quat(contents["path/pose/orientation"]).as_rotvec() for contents in (old, new))
    np.testing.assert_allclose(after, 2 * before, atol=1e-12)


def test_quaternions_shrink_where_their_sign_changes(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """Elsewhere they have unit length, but for what a mean over a turn takes away."""
    _, new, _ = pair_of("quaternions averaged across signs")
    norm = np.linalg.norm(new["path/pose/orientation"], axis=1)
    assert norm.min() < 0.6
    assert np.median(norm) > 0.9999


def test_kitti_has_forward_along_z(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Forward, left and up of the body are Z, -X and -Y; so are those of the world."""
    old, new, _ = pair_of("pose as KITTI's")
    before, after = (Rotation.from_quat(contents["path/pose/orientation"]) for contents in (old, new))
    x, y, z = before.apply([1.0, 0.0, 0.0]).T
    np.testing.assert_allclose(after.apply([0.0, 0.0, 1.0]), np.stack([-y, -z, x], axis=1), atol=1e-12)
    np.testing.assert_allclose(new["path/pose/position"], old["path/pose/position"][:, [1, 2, 0]] * [-1, -1, 1])


def test_blenders_camera_looks_backwards_along_z(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """Forward is -Z, up is Y."""
    old, new, _ = pair_of("attitude of Blender's camera")
    before, after = (Rotation.from_quat(contents["path/pose/orientation"]) for contents in (old, new))
    np.testing.assert_allclose(after.apply([0.0, 0.0, -1.0]), before.apply([1.0, 0.0, 0.0]), atol=1e-12)
    np.testing.assert_allclose(after.apply([0.0, 1.0, 0.0]), before.apply([0.0, 0.0, 1.0]), atol=1e-12)


def test_a_low_pass_of_the_gyro_is_late_by_its_constant(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """What it loses to the angle is its time constant times the change of the rate, less half a period."""
    old, new, plan = pair_of("gyro behind a low-pass")
    period_s = np.median(np.diff(old["path/imu/ts"])) / 1e6
    before, after = (contents["path/imu/angular_velocity"] for contents in (old, new))
    lost = (before - after).sum(axis=0) * period_s
    # Exact for any input: the output's own equation, summed over all samples.
    kept = np.exp(-1000 * period_s / plan.size)
    np.testing.assert_allclose(lost, period_s * kept / (1 - kept) * (after[-1] - before[0]), atol=1e-12)


def test_pixels_have_the_times_of_later_events(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """The first pixel has the time of the event so many behind; as many events are lost."""
    old, new, _ = pair_of("pixels behind their times")
    lost = len(old["path/events/t"]) - len(new["path/events/t"])
    assert lost > 0
    np.testing.assert_array_equal(new["path/events/t"], old["path/events/t"][lost:])


def test_the_right_sensor_sees_nothing_farther_right(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """The mean column gets smaller, by no more than the parallax of the nearest depth."""
    old, new, plan = pair_of("events of the right eye")
    focal = old["metadata/cameras/events@K"][0, 0]
    nearest_m = np.nanmin(old["path/depth"]) / 1000
    before, after = (contents["path/events/x"].mean(dtype=float) for contents in (old, new))
    assert before - focal * plan.size / nearest_m - 1 < after < before + 0.5


def test_short_flow_summed_in_place_is_flow_where_it_is_even(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """A sum over an interval differs from its flow by a small part at the median, and is absent where flow is."""
    old, new, _ = pair_of("flow of 10 Hz summed in place")
    before, after = (contents["path/flow/10hz"] for contents in (old, new))
    np.testing.assert_array_equal(np.isnan(after), np.isnan(before))
    assert 0 < np.nanmedian(np.abs(after - before)) < 0.1 * np.nanmedian(np.abs(before))


def test_a_stale_tile_is_that_of_the_frame_before(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Pixels that differ from what they were are those before the plan's frames, in a ninth of the image at most."""
    old, new, plan = pair_of("tile of depth stale for a while")
    before, after = (contents["path/depth"] for contents in (old, new))
    differs = ~((before == after) | (np.isnan(before) & np.isnan(after)))
    rows = plan.rows(len(before))
    assert set(np.flatnonzero(differs.any(axis=(1, 2)))) <= set(range(rows.start, rows.stop))
    stale = np.broadcast_to(after[rows.start - 1], after.shape)
    np.testing.assert_array_equal(after[differs], stale[differs])
    assert differs.any(axis=0).mean() < 1 / 9 + 0.01


def test_darker_events_of_a_preset_leave_less_than_one(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """A pixel's change of light, in thresholds, is that of its events, to less than an event and what comes behind."""
    old, new, plan = pair_of("darker events of a preset")
    shape = (int(old["metadata/cameras/events@height"]), int(old["metadata/cameras/events@width"]))
    totals = []
    for contents, darker in ((old, 1.0), (new, 1 + plan.size / 100)):
        total = np.zeros(shape)
        signs = np.where(contents["path/events/p"] == 1, 1.0, -darker)
        np.add.at(total, (contents["path/events/y"], contents["path/events/x"]), signs)
        totals.append(total)
    assert np.abs(totals[0] - totals[1]).max() < 1 + 1 + plan.size / 100
    assert len(new["path/events/t"]) < len(old["path/events/t"])


def test_what_is_left_in_a_buffer_has_been_written(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """All events are there first, and what follows them is a part of them, in their order."""
    old, new, _ = pair_of("last buffer of events not emptied")
    count, more = len(old["path/events/t"]), len(new["path/events/t"]) - len(old["path/events/t"])
    assert 0 < more < count
    for key in ("path/events/t", "path/events/x", "path/events/y", "path/events/p"):
        np.testing.assert_array_equal(new[key][:count], old[key])
    begin = np.flatnonzero(
        [np.array_equal(old["path/events/t"][at : at + more], new["path/events/t"][count:]) for at in range(count)]
    )
    assert len(begin) > 0


def test_numbers_of_pixels_stay_when_the_width_does_not(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """Those of events that are kept, by the width that was taken, are among those of all by the sensor's width."""
    old, new, plan = pair_of("numbers of pixels of another width")
    width = int(old["metadata/cameras/events@width"])
    before, after = (
        np.bincount(contents["path/events/y"].astype(int) * taken + contents["path/events/x"], minlength=2 * width**2)
        for contents, taken in ((old, width), (new, width + int(plan.size)))
    )
    assert np.all((after == before) | (after == 0))
    assert after.sum() > 0.8 * before.sum()


def test_warm_up_leaves_later_frames_in_sequence(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Frames behind the repeated first one are those of the beginning."""
    old, new, plan = pair_of("colour behind its warm-up")
    behind = int(plan.size)
    np.testing.assert_array_equal(new["path/rgb"][behind:], old["path/rgb"][:-behind])
    np.testing.assert_array_equal(new["path/rgb"][:behind], np.repeat(old["path/rgb"][:1], behind, axis=0))


def test_rays_of_a_wider_angle_shorten_depth_at_corners(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """By the ratio of both rays, which at a corner is that of sqrt(1 + tan^2) of its angles; not in the middle."""
    old, new, _ = pair_of("rays of depth with 90 degrees")
    ratio = new["path/depth"] / old["path/depth"]
    height, width = ratio.shape[1:]
    focal = old["metadata/cameras/depth@K"][0, 0]
    corner = np.hypot(width - 1, height - 1) / 2
    least = np.sqrt((1 + (corner / focal) ** 2) / (1 + (2 * corner / width) ** 2))
    assert np.nanmin(ratio) == pytest.approx(least, rel=1e-5)
    assert 0.999 < np.nanmax(ratio) <= 1 + 1e-6


def test_a_way_in_body_axes_is_as_long(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Its steps are turned, and begin at the same place."""
    old, new, _ = pair_of("way in body axes")
    before, after = (contents["path/pose/position"] for contents in (old, new))
    np.testing.assert_array_equal(after[0], before[0])
    steps = [np.linalg.norm(np.diff(position, axis=0), axis=1) for position in (before, after)]
    np.testing.assert_allclose(steps[1], steps[0], atol=1e-12)


def test_bits_in_reverse_are_reversed_by_bytes(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Of whole bytes, each eight polarities are in the other order."""
    old, new, _ = pair_of("bits of polarity unpacked in reverse")
    whole = len(old["path/events/p"]) // 8 * 8
    before, after = (contents["path/events/p"][:whole].reshape(-1, 8) for contents in (old, new))
    np.testing.assert_array_equal(after, before[:, ::-1])


def test_carla_is_the_mirror_image(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """What points forward, right and up of a left-handed body is the mirror image of forward, left and up."""
    old, new, _ = pair_of("pose of CARLA")
    before, after = (Rotation.from_quat(contents["path/pose/orientation"]) for contents in (old, new))
    mirror = np.array([1.0, -1.0, 1.0])
    for axis in np.eye(3):
        np.testing.assert_allclose(after.apply(mirror * axis), mirror * before.apply(axis), atol=1e-12)


def test_flipped_fields_are_mirror_images(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Each field is the old one or its mirror image, and some are of either sort."""
    old, new, _ = pair_of("flow flipped at random")
    before, after = old[KEYS[-1]], new[KEYS[-1]]
    mirrored = before[:, :, ::-1] * np.array([-1, 1], dtype=before.dtype)
    is_same, is_mirrored = (
        [np.array_equal(field, other, equal_nan=True) for field, other in zip(after, others, strict=True)]
        for others in (before, mirrored)
    )
    assert all(same or mirror for same, mirror in zip(is_same, is_mirrored, strict=True))
    assert any(is_same)
    assert any(is_mirrored)


def test_light_rises_from_black_to_the_first_frame(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """Brighter events are added within a period, in no pixel more than lead from black to white."""
    old, new, plan = pair_of("events of a black first frame")
    more = len(new["path/events/t"]) - len(old["path/events/t"])
    end_us = old["path/rgb_ts"][1]
    added = [np.sum((c["path/events/t"] <= end_us) & (c["path/events/p"] == 1)) for c in (old, new)]
    assert more > 0
    assert added[1] - added[0] == more
    pixels = int(old["metadata/cameras/events@width"]) * int(old["metadata/cameras/events@height"])
    assert more <= pixels * np.log(255 / plan.size) / old["metadata/events@threshold_on"]


def test_a_predicted_pose_is_a_later_one(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """It lies nearer to the pose so many ms later than to its own, in place and in attitude."""
    old, new, plan = pair_of("pose predicted for a display")
    behind = round(1000 * plan.size / np.median(np.diff(old["path/pose/ts"])))
    position = new["path/pose/position"][:-behind]
    late, own = (np.linalg.norm(position - old["path/pose/position"][rows], axis=1)
                 for rows in (slice(behind, None), slice(None, -behind)))  # fmt: skip
    assert np.median(late) < 0.3 * np.median(own)
    attitude = Rotation.from_quat(new["path/pose/orientation"][:-behind])
    late, own = ((Rotation.from_quat(old["path/pose/orientation"][rows]).inv() * attitude).magnitude()
                 for rows in (slice(behind, None), slice(None, -behind)))  # fmt: skip
    assert np.median(late) < 0.5 * np.median(own)


def test_colour_between_two_gaps_is_late(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """By as many frames as are absent; frames before the first gap and behind the second have their own times."""
    old, new, plan = pair_of("gap of colour times before that of frames")
    frames_us = {frame.tobytes(): us for frame, us in zip(old["path/rgb"], old["path/rgb_ts"], strict=True)}
    late_us = [us - frames_us[frame.tobytes()] for frame, us in zip(new["path/rgb"], new["path/rgb_ts"], strict=True)]
    period_us = np.median(np.diff(old["path/rgb_ts"]))
    changes = np.flatnonzero(np.diff(np.rint(late_us / period_us)))
    assert len(changes) == 2
    assert late_us[0] == late_us[-1] == 0
    assert late_us[changes[1]] == pytest.approx(plan.size * period_us, rel=0.01)


def test_gravity_behind_the_rotation_is_upright_in_the_body(
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
) -> None:
    """What is left of specific force without it is that of the right one without gravity."""
    old, new, _ = pair_of("gravity behind the rotation")
    key = "path/imu/linear_acceleration"
    rows = np.searchsorted(old["path/imu/ts"], old["path/pose/ts"])
    gravity = [0.0, 0.0, old["metadata/imu@gravity"]]
    upwards = Rotation.from_quat(old["path/pose/orientation"]).inv().apply(gravity)
    np.testing.assert_allclose(new[key][rows] - gravity, old[key][rows] - upwards, rtol=0, atol=1e-9)


def test_an_aligned_buffer_moves_each_row_farther(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """The second row begins with the ends of the first one, which have no value; no depth is made up."""
    old, new, _ = pair_of("rows of an aligned buffer of depth")
    before, after = (contents["path/depth"] for contents in (old, new))
    width = before.shape[2]
    padding = -width % 64 or 64
    np.testing.assert_array_equal(after[:, 0], before[:, 0])
    assert np.isnan(after[:, 1, : min(padding, width)]).all()
    np.testing.assert_array_equal(after[:, 1, padding:], before[:, 1, : width - padding])


def test_bits_of_time_are_columns_of_an_event(pair_of: Callable[[str], tuple[Contents, Contents, Plan]]) -> None:
    """What is added has the time, the row and the polarity of an event, and lies 24 to 31 columns behind it."""
    old, new, _ = pair_of("high words of time read as vectors")
    (rows_before, columns_before), (rows_after, columns_after) = (
        (
            np.stack([contents[f"path/events/{name}"].astype(np.int64) for name in "typ"], axis=1),
            contents["path/events/x"],
        )
        for contents in (old, new)
    )
    places = {(*row, int(column)) for row, column in zip(rows_before.tolist(), columns_before, strict=True)}
    added = [
        (*row, int(column))
        for row, column in zip(rows_after.tolist(), columns_after, strict=True)
        if (*row, int(column)) not in places
    ]
    assert added
    assert all(any((*event[:3], event[3] - offset) in places for offset in range(24, 32)) for event in added)
