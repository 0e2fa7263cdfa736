"""Score predictions against one sequence: field by field, so that memory does not grow with its length."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa import __version__
from fedora_qa.conventions import MM_PER_M, US_PER_S
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import MisuseError, UnreadableFileError, UnrecognisedError
from fedora_qa.geometry import so3
from fedora_qa.layout.canonical import flow_rate_hz, in_file_order, is_flow_stream, timestamps_of
from fedora_qa.layout.dialect import DialectChoice
from fedora_qa.record.types import Tool
from fedora_qa.record.wording import not_recognised
from fedora_qa.scoring.metrics import (
    ErrorSums,
    Partition,
    absolute_errors,
    by_depth,
    by_motion,
    depth_accuracy,
    depth_errors,
    flow_accuracy,
    flow_errors,
    near_edges,
    normalised_errors,
    relative_errors,
    share,
    whole_image,
)
from fedora_qa.scoring.predictions import (
    Predictions,
    PredictionsForm,
    RowReader,
    can_be_scored,
    canonical_shape,
    matched_rows,
    open_predictions,
)
from fedora_qa.scoring.types import (
    SCORE_VERSION,
    Alignment,
    DepthScore,
    ErrorAtTime,
    FlowScore,
    PoseScore,
    Score,
    TrajectoryError,
)
from fedora_qa.sequence.sequence import Sequence, file_times_us, open_sequence

Float32 = NDArray[np.float32]
Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

MOST_POINTS: Final = 200
"""Most points of errors over time: more rows are taken together."""

_SAME_RATIO: Final = 1.1
"""Ratio of two scales that may be the same: a learner errs by a few percent on average, a unit by far more."""

_ALIGNMENTS: Final[tuple[Alignment, ...]] = ("none", "rigid", "similarity")


class _PairedSequence:
    """The truth and its predictions."""

    def __init__(self, truth: Sequence, predicted: Predictions) -> None:
        self.truth = truth
        self.predicted = predicted
        self.notes: list[str] = []
        self._shapes: dict[str, tuple[int, ...]] = {}
        bounds_m = truth.declared.depth_range_m
        self._farthest_m = bounds_m[1] if bounds_m else None
        self._depth = self.true_rows("path/depth") if "depth" in truth.layout.streams else None
        self._depth_times_us = self._times_us("depth") if self._depth else np.empty(0, np.int64)
        if self._depth and not bounds_m and predicted.streams != {"pose"}:
            self.notes.append("The sequence declares no range of depth: errors are not divided by edges of depth.")

    def matched(self, stream: str, key: str) -> tuple[Int64, Int64]:
        """Return the timestamps of a stream of the truth, and which row of its predictions is of each, or -1.

        Parameters
        ----------
        stream
            Both have it.

        Returns
        -------
        times_us
            (n,) timestamps or (n, 2) intervals, us on the clock of the file.
        matched
            (n,) as ``matched_rows``.

        Raises
        ------
        MisuseError
            Shapes or timestamps do not fit.
        """
        of = f"{stream} in {self.predicted.path}"
        times_us, shape, predicted_shape = self._times_us(stream), self.shape(key), self.predicted.shape(key)
        if predicted_shape[1:] != shape[1:]:
            raise MisuseError(
                f"Expected {of} of {_size(shape)} as in the sequence, got {_size(predicted_shape)}; resize the "
                "predictions, and scale flow with them"
            )
        predicted_us = self.predicted.times_us(stream)
        if predicted_us is not None:
            return times_us, matched_rows(times_us, predicted_us, of)
        if predicted_shape[0] != len(times_us):
            raise MisuseError(
                f"Expected {of} for each of {len(times_us)} intervals, as no timestamps lie beside the images, got "
                f"{predicted_shape[0]} images; add forward_timestamps.txt"
            )
        return times_us, np.arange(len(times_us))

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the shape of a dataset of the truth in canonical form, which a dialect may store in another."""
        if key not in self._shapes:
            self._shapes[key] = canonical_shape(self.truth, key)
        return self._shapes[key]

    def true_rows(self, key: str) -> RowReader:
        """Return a reader of the rows of the truth."""
        return RowReader(self.truth, key, self.shape(key))

    def predicted_rows(self, key: str) -> RowReader:
        """Return a reader of the rows of the predictions."""
        return RowReader(self.predicted, key, self.predicted.shape(key))

    def depth_partitions(self, depth_m: Float32) -> list[Partition]:
        """Divide pixels by the true depth (H, W), m, and by how near an edge they are where the range is declared.

        Without a range a missing depth may be far, or only unknown, so that it is not clear where edges are.
        """
        edges = [near_edges(depth_m, self._farthest_m)] if self._farthest_m else []
        return [by_depth(depth_m), *edges]

    def depth_at(self, time_us: int, size: tuple[int, ...]) -> Float32 | None:
        """Return the true depth at an instant, m; None where there is no frame, or it has another size (H, W)."""
        rows = np.flatnonzero(self._depth_times_us == time_us)
        if self._depth is None or not len(rows):
            return None
        depth_m = _depth_in_m(self._depth.row(int(rows[0])))
        return depth_m if depth_m.shape == tuple(size) else None

    def _times_us(self, stream: str) -> Int64:
        key = timestamps_of(stream)
        return file_times_us(self.truth, key, 0, self.truth.layout.bindings[key].rows)


def score_sequence(
    predictions: Path,
    sequence: Path,
    form: PredictionsForm | None,
    dialect: DialectChoice,
    allow_external: Iterable[Path],
    progress: Progress,
) -> Score:
    """Score predictions against a sequence.

    Parameters
    ----------
    predictions
        An HDF5 file in canonical keys, or a folder of images.
    form
        What the predictions are; None: as they lie there.
    dialect
        Of the sequence; None: as it is recognised.
    allow_external
        Folders with other files that the sequence may link to.
    progress
        Called with the stream, how many rows of it are done, and of how many.

    Raises
    ------
    MisuseError
        A file is missing, or predictions cannot be read or do not fit the sequence.
    FedoraError
        The sequence cannot be opened, or rows of it cannot be decoded.
    """
    with _open_truth(sequence, dialect, allow_external) as truth, open_predictions(predictions, form) as predicted:
        _require_truth(truth, predicted)
        pair = _PairedSequence(truth, predicted)
        flow_streams = filter(is_flow_stream, in_file_order(predicted.streams))
        flow = tuple(score_flow(pair, stream, progress) for stream in flow_streams)
        depth = score_depth(pair, progress) if "depth" in predicted.streams else None
        pose = score_pose(pair) if "pose" in predicted.streams else None
        unpredicted = filter(can_be_scored, in_file_order(truth.layout.streams - predicted.streams))
        for what, streams in (
            ("Not predicted", tuple(unpredicted)),
            ("Predicted, and not scored, as there is no metric", predicted.others),
        ):
            if streams:
                pair.notes.append(f"{what}: {', '.join(streams)}.")
        return Score(
            score_version=SCORE_VERSION,
            tool=Tool("fedora-qa", __version__),
            predictions=str(predictions),
            sequence=str(sequence),
            flow=flow,
            depth=depth,
            pose=pose,
            notes=tuple(pair.notes),
        )


def score_flow(pair: _PairedSequence, stream: str, progress: Progress) -> FlowScore:
    """Score flow at one rate."""
    key, moving_key = f"path/{stream}", f"path/{stream}_moving"
    intervals_us, matched = pair.matched(stream, key)
    true_rows, predicted_rows = pair.true_rows(key), pair.predicted_rows(key)
    moving = pair.true_rows(moving_key) if moving_key in pair.truth.layout.bindings else None
    absent = np.full(pair.shape(key)[1:], np.nan, np.float32)
    whole = whole_image(*absent.shape[:2])
    sums, errors, without_depth = ErrorSums(), [], 0
    for row, place in enumerate(matched.tolist()):
        partitions = [whole]
        depth_m = pair.depth_at(int(intervals_us[row, 0]), absent.shape[:2])
        if depth_m is None:
            without_depth += 1
        else:
            partitions += pair.depth_partitions(depth_m)
        if moving:
            partitions.append(by_motion(moving.row(row)))
        values, valid = flow_errors(true_rows.row(row), predicted_rows.row(place) if place >= 0 else absent)
        sums.add(values, valid, partitions)
        errors.append((values["error_px"].sum(), values["scored"].sum()))
        progress(stream, row + 1, len(matched))
    parts = tuple(flow_accuracy(part, totals) for part, totals in sums.totals().items())

    rate_hz = flow_rate_hz(stream)
    if without_depth:
        pair.notes.append(
            f"{stream}: no depth frame at the start of {without_depth} of {len(matched)} intervals; these are not "
            "divided by depth, nor by edges of depth."
        )
    if pair.truth.declared.flow_model == "scene" and not moving:
        pair.notes.append(f"{stream}: objects may move by themselves, and no labels say which pixels show them.")
    if parts and parts[0].mean_flow_px and parts[0].mean_predicted_flow_px:
        ratio = parts[0].mean_predicted_flow_px / parts[0].mean_flow_px
        # At about 1 Hz both units are the same.
        if rate_hz > _SAME_RATIO**2 and rate_hz / _SAME_RATIO < ratio < rate_hz * _SAME_RATIO:
            pair.notes.append(
                f"{stream}: predicted flow is {ratio:.3g} times as long as true flow, as if it were in px/s; flow is "
                "in px over its interval."
            )
    return FlowScore(
        stream=stream,
        rate_hz=rate_hz,
        fields=len(matched),
        predicted_fields=int(np.count_nonzero(matched >= 0)),
        parts=parts,
        over_time=errors_over_time(intervals_us, np.array(errors).reshape(-1, 2)),
    )


def score_depth(pair: _PairedSequence, progress: Progress) -> DepthScore:
    """Score depth and disparity."""
    key = "path/depth"
    times_us, matched = pair.matched("depth", key)
    true_rows, predicted_rows = pair.true_rows(key), pair.predicted_rows(key)
    absent = np.full(pair.shape(key)[1:], np.nan, np.float32)
    whole = whole_image(*absent.shape)
    sums, errors = ErrorSums(), []
    for row, place in enumerate(matched.tolist()):
        truth_m = _depth_in_m(true_rows.row(row))
        values, valid = depth_errors(truth_m, _depth_in_m(predicted_rows.row(place)) if place >= 0 else absent)
        sums.add(values, valid, [whole, *pair.depth_partitions(truth_m)])
        errors.append((values["disparity_error_per_m"].sum(), values["disparity_per_m"].sum()))
        progress("depth", row + 1, len(matched))
    parts = tuple(depth_accuracy(part, totals) for part, totals in sums.totals().items())
    log_ratio = parts[0].mean_log_error if parts else None
    if log_ratio is not None and abs(log_ratio + math.log(MM_PER_M)) < math.log(_SAME_RATIO):
        pair.notes.append(f"depth: predictions are a thousandth of the truth, as if they were in m; {key} is in mm.")
    return DepthScore(
        frames=len(matched),
        predicted_frames=int(np.count_nonzero(matched >= 0)),
        parts=parts,
        over_time=errors_over_time(times_us, np.array(errors).reshape(-1, 2)),
    )


def score_pose(pair: _PairedSequence) -> PoseScore:
    """Score poses. All are read at once: an hour of 200 Hz takes 40 MB."""
    times_us, matched = pair.matched("pose", "path/pose/position")
    positions, orientations, predicted_positions, predicted_orientations = (
        np.asarray(source.rows(f"path/pose/{part}", 0, count), np.float64)
        for source, count in ((pair.truth, len(matched)), (pair.predicted, pair.predicted.shape("path/pose/ts")[0]))
        for part in ("position", "orientation")
    )
    valid = _are_poses(positions, orientations)
    scored = valid & (matched >= 0)
    scored[scored] = _are_poses(predicted_positions, predicted_orientations)[matched[scored]]
    places = matched[scored]
    truth = positions[scored], so3.normalise(orientations[scored])
    predicted = predicted_positions[places], so3.normalise(predicted_orientations[places])
    errors: list[TrajectoryError] = []
    over_time: tuple[ErrorAtTime, ...] = ()
    if len(places):
        for alignment in _ALIGNMENTS:
            absolute = tuple(absolute_errors(truth, predicted, alignment))
            errors += absolute
            if not absolute:
                pair.notes.append(f"pose: positions lie on a line, so that no {alignment} alignment is determined.")
        # One step, as evo has it by default; and as many as make a second, as the error of a step depends on the rate.
        scored_us = times_us[scored]
        step_us = float(np.median(np.diff(scored_us))) if len(places) > 1 else 0.0
        steps = max(1, round(US_PER_S / step_us)) if step_us > 0 else 1
        for delta in dict.fromkeys((1, steps)):
            errors += relative_errors(truth, predicted, delta)
        distances_m = np.linalg.norm(predicted[0] - truth[0], axis=1)
        over_time = errors_over_time(scored_us, np.column_stack([distances_m, np.ones(len(places))]))
    noise = pair.truth.declared.pose
    if noise and (noise.position_sigma_m or noise.rotation_sigma_rad):
        pair.notes.append(
            f"pose: the true poses carry noise of {noise.position_sigma_m:.3g} m and "
            f"{math.degrees(noise.rotation_sigma_rad):.3g} deg per axis, which is in every error."
        )
    return PoseScore(
        poses=int(np.count_nonzero(valid)),
        scored_poses=len(places),
        coverage=share(len(places), int(np.count_nonzero(valid))),
        normalised=tuple(normalised_errors(truth, predicted)) if len(places) else (),
        errors=tuple(errors),
        over_time=over_time,
    )


def errors_over_time(times_us: Int64, errors: Float64) -> tuple[ErrorAtTime, ...]:
    """Return mean errors of successive rows, at most ``MOST_POINTS``.

    Parameters
    ----------
    times_us
        (n,) timestamps, or (n, 2) intervals, us.
    errors
        (n, 2) sum of the errors of each row, and what it is divided by for the mean.
    """
    times = times_us.reshape(len(times_us), -1)
    counted = np.flatnonzero(errors[:, 1] > 0)
    order = counted[np.argsort(times[counted, 0], kind="stable")]
    points = []
    for rows in np.array_split(order, max(1, min(MOST_POINTS, len(order)))):
        if len(rows):
            error = errors[rows, 0].sum() / errors[rows, 1].sum()
            points.append(ErrorAtTime(int(times[rows[0], 0]), int(times[rows, -1].max()), float(error)))
    return tuple(points)


def _open_truth(sequence: Path, dialect: DialectChoice, allow_external: Iterable[Path]) -> Sequence:
    """Open the sequence; an error names it, as predictions are opened beside it."""
    try:
        truth = open_sequence(sequence, dialect, allow_external=allow_external)
    except UnreadableFileError as error:
        raise UnreadableFileError(f"{error} ({sequence})") from error
    if not truth.layout.is_recognised:
        truth.close()
        raise UnrecognisedError(not_recognised(sequence))
    return truth


def _require_truth(truth: Sequence, predicted: Predictions) -> None:
    """Raise ``MisuseError`` where a stream is predicted that the sequence does not have."""
    for stream in in_file_order(predicted.streams - truth.layout.streams):
        present = ", ".join(filter(can_be_scored, in_file_order(truth.layout.streams))) or "nothing to score"
        raise MisuseError(
            f"Expected {stream} in {truth.path}, as it is predicted in {predicted.path}, got {present}; leave {stream} "
            "out of the predictions"
        )


def _are_poses(positions: Float64, orientations_xyzw: Float64) -> NDArray[np.bool_]:
    """Return which rows (n,) are finite, with a quaternion that is a rotation when scaled."""
    lengths = np.linalg.norm(orientations_xyzw, axis=1)
    return np.asarray(np.isfinite(positions).all(axis=1) & np.isfinite(lengths) & (lengths > 0))


def _depth_in_m(depth_mm: NDArray[Any]) -> Float32:
    """Return depth in m."""
    return np.asarray(depth_mm, np.float32) / np.float32(MM_PER_M)


def _size(shape: tuple[int, ...]) -> str:
    """Return the size of the rows of a dataset, in words."""
    return f"{shape[2]} x {shape[1]} px" if len(shape) > 2 else f"{shape[1]} columns"
