"""Predictions scored against a small sequence: what counts, in which part of the image, and what is refused."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.engine.progress import quiet
from fedora_qa.errors import MisuseError, UnreadableRowsError
from fedora_qa.scoring.predictions import PredictionsForm, RowReader
from fedora_qa.scoring.score import MOST_POINTS, errors_over_time, score_sequence
from fedora_qa.scoring.types import Score
from fedora_qa.sequence.sequence import file_times_us, open_sequence
from tests.support.dsec_folder import encode_flow, write_dsec_folder, write_png
from tests.support.handmade import write_handmade
from tests.support.predictions import (
    FIELDS,
    HEIGHT,
    POSES,
    STEP_US,
    WIDTH,
    of_stream,
    truth,
    write_predictions,
    write_truth,
)

Array = np.ndarray[Any, Any]
OFFSET_PX = np.float32([0.375, 0.5])
FLOW = truth()["path/flow/50hz"]
INTERVALS = truth()["path/flow/50hz_ts"]
LONGER = np.array([[0, 0], [0, 0], [0, 0], [0, 5]])


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """The sequence with the truth."""
    return write_truth(tmp_path / "seq.h5")


def scored(sequence: Path, *streams: dict[str, Array], form: PredictionsForm | None = None) -> Score:
    """The score of predictions of some streams."""
    datasets = {key: values for stream in streams for key, values in stream.items()}
    predictions = write_predictions(sequence.with_name("predictions.h5"), datasets)
    return score_sequence(predictions, sequence, form, None, (), quiet)


def test_parts_of_flow(sequence: Path) -> None:
    """Errors on the moving block, on near pixels and beside the step of depth are found in their own part alone."""
    predicted = FLOW.copy()
    predicted[:, 10:14, 20:30] += OFFSET_PX
    parts = {part.part: part for part in scored(sequence, of_stream("flow", **{"50hz": predicted})).flow[0].parts}
    assert parts["moving objects"].aee_px == 0.625
    assert parts["static world"].aee_px == parts["4 to 8 m"].aee_px == 0.0
    assert parts["all"].aee_px == 0.625 * 40 / (22 * WIDTH)
    assert parts["4 to 8 m"].valid_pixels + parts["16 to 32 m"].valid_pixels == parts["all"].valid_pixels
    # Depth steps between columns 7 and 8, and between rows 1 and 2, as it is beyond the range above. Pixels less than
    # 10 px from either side are near: up to column 17, and up to row 11.
    near = FIELDS * (10 * WIDTH + 12 * 18)
    assert parts["near an edge of depth"].valid_pixels == near
    assert parts["away from edges"].valid_pixels == FIELDS * 22 * WIDTH - near


def test_missing_fields_lower_the_coverage(sequence: Path) -> None:
    """One field of four, in which a row has no prediction; the error is over what is predicted."""
    predicted = FLOW[2:3] + OFFSET_PX
    predicted[0, 5] = np.nan
    flow = scored(sequence, of_stream("flow", **{"50hz": predicted, "50hz_ts": INTERVALS[2:3]})).flow[0]
    assert (flow.fields, flow.predicted_fields) == (FIELDS, 1)
    assert flow.parts[0].coverage == 21 / (FIELDS * 22)
    assert flow.parts[0].aee_px == 0.625
    assert [(point.start_us, point.stop_us, point.error) for point in flow.over_time] == [(40_000, 60_000, 0.625)]


def test_order_of_rows_changes_nothing(sequence: Path) -> None:
    """Predictions last first are matched by their timestamps; every number is the same."""
    predicted = FLOW + np.random.default_rng(3).normal(size=FLOW.shape).astype(np.float32)
    forward = scored(sequence, of_stream("flow", **{"50hz": predicted}))
    backward = scored(sequence, of_stream("flow", **{"50hz": predicted[::-1], "50hz_ts": INTERVALS[::-1]}))
    assert backward == forward


def test_another_origin_of_time(tmp_path: Path) -> None:
    """Timestamps since 1970 are matched on the clock of the file, whichever streams were predicted."""
    epoch_us = 1_700_000_000_000_000
    late = {key: values + epoch_us for key, values in truth().items() if key.endswith("ts")}
    sequence = write_truth(tmp_path / "seq.h5", **late)
    flow = of_stream("flow", **{"50hz": FLOW[1:], "50hz_ts": INTERVALS[1:] + epoch_us})
    result = scored(sequence, flow, of_stream("pose", ts=truth()["path/pose/ts"] + epoch_us))
    assert result.flow[0].parts[0].naee == 0.0
    assert result.flow[0].over_time[0].start_us == epoch_us + STEP_US
    assert result.pose is not None
    assert result.pose.coverage == 1.0


def test_depth_and_pose(sequence: Path) -> None:
    """A gain of depth and a shift of positions have their closed forms; a NaN quaternion is a missing pose."""
    orientations = truth()["path/pose/orientation"].copy()
    orientations[3] = np.nan
    pose = of_stream("pose", position=truth()["path/pose/position"] + [0.3, 0.0, 0.4], orientation=2 * orientations)
    result = scored(sequence, of_stream("depth", depth=1.25 * truth()["path/depth"]), pose)
    assert result.depth is not None
    assert result.pose is not None
    assert [part.part for part in result.depth.parts] == [
        "all", "4 to 8 m", "16 to 32 m", "near an edge of depth", "away from edges"
    ]  # fmt: skip
    assert [part.nade for part in result.depth.parts] == pytest.approx([0.2] * 5, rel=1e-6)
    assert (result.pose.scored_poses, result.pose.coverage) == (POSES - 1, (POSES - 1) / POSES)
    ate = result.pose.errors[0]
    assert (ate.metric, ate.relation, ate.alignment) == ("ATE", "translation", "none")
    assert (ate.rmse, ate.std) == pytest.approx((0.5, 0.0), abs=1e-12)
    aligned = next(error for error in result.pose.errors if error.alignment == "rigid")
    assert aligned.max == pytest.approx(0.0, abs=1e-12)
    assert result.notes == ("Not predicted: flow/50hz.",)


def test_relative_errors_over_a_second(tmp_path: Path) -> None:
    """The second distance is as many poses as make a second at their usual step; shorter paths have no such pair."""
    times_us = 100_000 * np.arange(12)
    motion = {
        "path/pose/position": np.random.default_rng(0).normal(size=(12, 3)),
        "path/pose/orientation": np.tile([0.0, 0.0, 0.0, 1.0], (12, 1)),
        "path/pose/ts": times_us,
    }
    sequence = write_truth(tmp_path / "seq.h5", **motion)
    pose = scored(sequence, motion).pose
    short = scored(sequence, {key: values[:5] for key, values in motion.items()}).pose
    assert pose is not None
    assert short is not None
    assert [(error.delta_poses, error.count) for error in pose.errors if error.metric == "RPE"] == [
        (1, 11), (1, 11), (10, 2), (10, 2)
    ]  # fmt: skip
    assert {error.delta_poses for error in short.errors if error.metric == "RPE"} == {1}


def test_units_that_are_wrong_are_noted(sequence: Path) -> None:
    """Depth in m and flow in px/s are scored as they are; a note says what they look like. An error of 9% is none."""
    wrong = scored(
        sequence, of_stream("flow", **{"50hz": 50 * FLOW}), of_stream("depth", depth=truth()["path/depth"] / 1000)
    )
    assert ["px/s" in note or "in m;" in note for note in wrong.notes] == [True, True, False]
    assert wrong.flow[0].parts[0].naee == pytest.approx(49)
    right = scored(sequence, of_stream("flow", **{"50hz": 1.09 * FLOW}), of_stream("depth"))
    assert right.notes == ("Not predicted: pose.",)


def test_what_a_sequence_lacks_is_noted(tmp_path: Path) -> None:
    """Without depth, labels or a declared range, parts are left out, and a note says so; what is no stream as well."""
    sequence = write_truth(tmp_path / "seq.h5", "path/depth", "path/depth_ts", "path/flow/50hz_moving")
    with h5py.File(sequence, "r+") as file:
        file.create_group("metadata/flow").attrs.update({"unit": "px", "model": "scene"})
        file.create_group("metadata/pose").attrs.update({"position_sigma": 0.02, "rotation_sigma": 0.01})
    imu = {"path/imu/angular_velocity": np.zeros((3, 3)), "path/imu/linear_acceleration": np.zeros((3, 3))}
    result = scored(sequence, of_stream("flow"), of_stream("pose"), imu | {"path/imu/ts": np.arange(3)})
    assert [part.part for part in result.flow[0].parts] == ["all"]
    for words in ("no depth frame", "no labels", "0.02 m and 0.573 deg", "not scored, as there is no metric: imu"):
        assert any(words in note for note in result.notes), words


REFUSED: dict[str, tuple[dict[str, Array], str]] = {
    "times": (of_stream("flow", **{"50hz_ts": INTERVALS + 5}),
              "4 from 0 to 80000 us, got 4 of 4 .* 5 to 20005 us; copy"),
    "one interval": (of_stream("flow", **{"50hz_ts": INTERVALS + LONGER}),
                     "got 1 of 4 at others, the first at 60000 to 80005 us"),
    "twice": (of_stream("flow", **{"50hz_ts": INTERVALS[[0, 1, 2, 2]]}), "got 4 at 3; keep one"),
    "size": (of_stream("flow", **{"50hz": FLOW[:, ::2, ::2]}), "32 x 24 px as in the sequence, got 16 x 12 px; resize"),
    "count": (of_stream("flow", **{"50hz": FLOW[:3]}), "K50 = 3"),
    "no times": ({"path/flow/50hz": FLOW}, "path/flow/50hz_ts"),
    "text": (of_stream("flow", **{"50hz": np.array([b"x"] * FIELDS)}), "as float32, got"),
    "rate": ({"path/flow/10hz": FLOW, "path/flow/10hz_ts": INTERVALS},
             "Expected flow/10hz in .* got depth, pose, flow/50hz"),
    "no stream": ({"prediction": FLOW}, "at path/flow/<rate>hz, path/depth or path/pose"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused(sequence: Path, case: str) -> None:
    """In one sentence that says what was expected, what was got, and what to do."""
    datasets, words = REFUSED[case]
    with pytest.raises(MisuseError, match=words) as refused:
        scored(sequence, datasets)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("Expected")
    assert ";" in str(refused.value)


def test_rows_that_cannot_be_decoded(tmp_path: Path) -> None:
    """Of predictions they are misuse; of the sequence they end the score with its own error."""
    sound, damaged = write_truth(tmp_path / "sound.h5"), tmp_path / "damaged.h5"
    write_truth(damaged, "path/flow/50hz")
    with h5py.File(damaged, "r+") as file:
        stored = file.create_dataset("path/flow/50hz", data=FLOW, chunks=(1, *FLOW.shape[1:]), fletcher32=True)
        place = stored.id.get_chunk_info(2).byte_offset
    with damaged.open("r+b") as raw:
        raw.seek(place + 100)
        raw.write(b"\x55" * 8)
    with pytest.raises(MisuseError, match=r"damaged\.h5; write the predictions again"):
        score_sequence(damaged, sound, None, None, (), quiet)
    with pytest.raises(UnreadableRowsError, match="rows 2 to 3"):
        score_sequence(sound, damaged, None, None, (), quiet)


@pytest.mark.parametrize(("size", "blocks"), [((4, 4), [(0, 8), (16, 20), (0, 8)]), ((4096, 4096), [])])
def test_rows_are_read_in_bounded_blocks(size: tuple[int, int], blocks: list[tuple[int, int]]) -> None:
    """Rows that are stored together are read together, once; of large ones not more than one at a time."""
    requests = []

    class Chunks:
        """Twenty rows in chunks of eight; each holds its own number."""

        def chunk_rows(self, key: str) -> int:
            return 8

        def rows(self, key: str, start: int, stop: int) -> Array:
            requests.append((start, stop))
            return np.arange(start, stop)

    reader = RowReader(Chunks(), "path/depth", (20, *size))  # type: ignore[arg-type]
    order = (0, 1, 7, 16, 19, 2)
    assert tuple(int(reader.row(place)) for place in order) == order
    assert requests == (blocks or [(place, place + 1) for place in order])


def test_errors_over_time_are_means_of_neighbours() -> None:
    """In the order of time, weighted by what they count, at most so many; a row without any is left out."""
    times_us = np.arange(1000)[::-1] * 10
    errors = np.column_stack([np.ones(1000), np.where(times_us < 5000, 1.0, 4.0)])
    errors[0] = 0.0
    points = errors_over_time(times_us, errors)
    assert len(points) == MOST_POINTS
    assert (points[0].start_us, points[0].stop_us, points[0].error) == (0, 40, 1.0)
    assert (points[-1].stop_us, points[-1].error) == (9980, 0.25)


def as_images(folder: Path, flow_px: Array, numbers: range, times: str = "") -> Path:
    """A folder of images, as a learner submits them, with a file of times if there is one."""
    folder.mkdir()
    for number, field_px in zip(numbers, flow_px, strict=True):
        write_png(folder / f"{number:06d}.png", encode_flow(field_px))
    if times:
        lines = [f"{start}, {stop}, {number}" for number, (start, stop) in zip(numbers, INTERVALS, strict=False)]
        (folder / times).write_text("\n".join(["# from, to, index", *lines]))
    return folder


@pytest.fixture
def ten_hz(tmp_path: Path) -> Path:
    """The sequence with its flow at 10 Hz, the rate of DSEC."""
    flow = {key.replace("50hz", "10hz"): values for key, values in of_stream("flow").items()}
    return write_truth(tmp_path / "seq.h5", "path/flow/50hz", "path/flow/50hz_ts", "path/flow/50hz_moving", **flow)


def test_images_as_dsec_has_them(ten_hz: Path, tmp_path: Path) -> None:
    """One for each interval, in the order of their numbers; 1/128 px is kept, and what is not valid is missing."""
    folder = as_images(tmp_path / "images", FLOW + OFFSET_PX, range(98, 106, 2))
    flow = score_sequence(folder, ten_hz, None, None, (), quiet).flow[0]
    assert (flow.stream, flow.parts[0].coverage, flow.parts[0].aee_px) == ("flow/10hz", 1.0, 0.625)


def test_images_with_times(ten_hz: Path, tmp_path: Path) -> None:
    """Lines of a table give each image its interval, by its number where they state it: some may be missing."""
    folder = as_images(tmp_path / "images", FLOW[:2], range(7, 9), "sequence.csv")
    flow = score_sequence(folder, ten_hz, "dsec", None, (), quiet).flow[0]
    assert (flow.predicted_fields, flow.parts[0].coverage, flow.parts[0].aee_px) == (2, 0.5, 0.0)
    (folder / "000007.png").rename(folder / "000011.png")
    with pytest.raises(MisuseError, match=r"none for 000011\.png; name images by it"):
        score_sequence(folder, ten_hz, None, None, (), quiet)


def test_images_that_do_not_fit(ten_hz: Path, tmp_path: Path) -> None:
    """Too few without times, grey ones, none, a damaged one, a file in place of the folder: each is misuse."""
    few = as_images(tmp_path / "few", FLOW[:3], range(3))
    grey = tmp_path / "grey"
    grey.mkdir()
    write_png(grey / "0.png", np.zeros((HEIGHT, WIDTH), np.uint8))
    damaged = as_images(tmp_path / "damaged", FLOW, range(4))
    (damaged / "000001.png").write_bytes((damaged / "000001.png").read_bytes()[:200])
    (tmp_path / "none").mkdir()
    for path, form, words in (
        (few, None, "each of 4 intervals, .* got 3 images; add forward_timestamps.txt"),
        (grey, None, "three channels .* got 32 x 24 pixels, 8-bit grey; encode"),
        (damaged, None, "damaged; write the predictions again"),
        (tmp_path / "none", None, "got none; write one for each interval"),
        (ten_hz, "dsec", "a folder of PNG images with --format dsec"),
        (few, "canonical", "an HDF5 file with --format canonical"),
    ):
        with pytest.raises(MisuseError, match=words):
            score_sequence(path, ten_hz, form, None, (), quiet)  # type: ignore[arg-type]


def test_a_sequence_in_another_dialect(tmp_path: Path) -> None:
    """A folder of DSEC stores three channels of flow and another form of depth: what it holds is its own prediction."""
    folder = write_dsec_folder(write_handmade(tmp_path / "handmade.h5"), tmp_path / "dsec")
    images = score_sequence(folder / "optical_flow/forward", folder, None, None, (), quiet)
    assert [(part.part, part.coverage, part.aee_px) for part in images.flow[0].parts] == [
        ("all", 1.0, 0.0), ("4 to 8 m", 1.0, 0.0)
    ]  # fmt: skip
    with open_sequence(folder) as opened:
        depth_mm = opened.rows("path/depth", 0, 2)
        times_us = file_times_us(opened, "path/depth_ts", 0, 2)
    depth = scored(folder, {"path/depth": depth_mm, "path/depth_ts": times_us}).depth
    assert depth is not None
    assert (depth.parts[0].coverage, depth.parts[0].rmse_m) == (1.0, 0.0)
