"""Score predictions against one sequence: field by field, so that memory does not grow with its length."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa import __version__
from fedora_qa.conventions import MM_PER_M, US_PER_S
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import MisuseError
from fedora_qa.geometry import so3
from fedora_qa.layout.canonical import flow_rate_hz, in_file_order, is_flow_stream, timestamps_of
from fedora_qa.layout.dialect import DialectChoice
from fedora_qa.record.types import Tool
from fedora_qa.scoring.depth_errors import depth_accuracy, depth_errors
from fedora_qa.scoring.error_sums import ErrorSums, Partition, share
from fedora_qa.scoring.flow_errors import flow_accuracy, flow_errors
from fedora_qa.scoring.image_parts import by_depth, by_motion, near_edges, whole_image
from fedora_qa.scoring.predictions import (
    Predictions,
    PredictionsForm,
    RowReader,
    can_be_scored,
    matched_rows,
    open_predictions,
)
from fedora_qa.scoring.trajectory_errors import absolute_errors, normalised_errors, relative_errors
from fedora_qa.scoring.types import (
    SCORE_VERSION,
    Alignment,
    DepthScore,
    ErrorAtTime,
    FlowScore,
    PoseScore,
    Score,
)
from fedora_qa.sequence.file_time import file_times_us
from fedora_qa.sequence.sequence import Sequence as OpenSequence
from fedora_qa.sequence.sequence import open_sequence

Int64 = NDArray[np.int64]

MOST_POINTS: Final = 200
"""Most points of errors over time: more rows are taken together."""

_SAME_RATIO: Final = 1.1
"""Ratio of two scales that may be the same: a learner errs by a few percent on average, a unit by far more."""

_ALIGNMENTS: Final[tuple[Alignment, ...]] = ("none", "rigid", "similarity")


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
    sequence
        The file or folder with the truth.
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
    with open_sequence(sequence, dialect, allow_external=allow_external) as truth, open_predictions(predictions, form) as predicted:
        run = _Run(truth, predicted, progress)
        streams = in_file_order(predicted.streams)
        for stream in streams:
            if stream not in truth.layout.streams:
                present = ", ".join(filter(can_be_scored, in_file_order(truth.layout.streams))) or "nothing to score"
                raise MisuseError(
                    f"Expected {stream} in {sequence}, as it is predicted in {predictions}, got {present}; leave "
                    f"{stream} out of the predictions"
                )
        flow = tuple(run.flow(stream) for stream in streams if is_flow_stream(stream))
        depth = run.depth() if "depth" in streams else None
        pose = run.pose() if "pose" in streams else None
        unpredicted = [
            stream for stream in in_file_order(truth.layout.streams - predicted.streams) if can_be_scored(stream)
        ]
        if unpredicted:
            run.notes.append(f"Not predicted: {', '.join(unpredicted)}.")
        if predicted.others:
            run.notes.append(f"Predicted, and not scored, as there is no metric: {', '.join(predicted.others)}.")
        return Score(
            score_version=SCORE_VERSION,
            tool=Tool("fedora-qa", __version__),
            predictions=str(predictions),
            sequence=str(sequence),
            flow=flow,
            depth=depth,
            pose=pose,
            notes=tuple(run.notes),
        )


class _Run:
    """A sequence and its predictions, both open, and what is to be noted."""

    def __init__(self, truth: OpenSequence, predicted: Predictions, progress: Progress) -> None:
        self.truth = truth
        self.predicted = predicted
        self.progress = progress
        self.notes: list[str] = []
        bounds_m = truth.declared.depth_range_m
        self._farthest_m = bounds_m[1] if bounds_m else None
        self._depth = self._reader("path/depth") if "depth" in truth.layout.streams else None
        self._depth_times_us = self._times_us("depth") if self._depth else np.empty(0, np.int64)

    def flow(self, stream: str) -> FlowScore:
        """Score flow at one rate."""
        key, moving_key = f"path/{stream}", f"path/{stream}_moving"
        intervals_us, matched = self._matched(stream, key)
        truth_rows, predicted_rows = self._reader(key), RowReader(self.predicted, key, self.predicted.shape(key))
        moving = self._reader(moving_key) if moving_key in self.truth.layout.bindings else None
        absent = np.full(self.truth.layout.bindings[key].shape[1:], np.nan, np.float32)
        whole = whole_image(*absent.shape[:2])
        sums, errors, without_depth = ErrorSums(), [], 0
        for row, place in enumerate(matched.tolist()):
            partitions = [whole]
            depth_m = self._depth_m(int(intervals_us[row, 0]), absent.shape[:2])
            without_depth += depth_m is None
            if depth_m is not None:
                partitions += self._depth_partitions(depth_m)
            if moving:
                partitions.append(by_motion(moving.row(row)))
            predicted_px = predicted_rows.row(place) if place >= 0 else absent
            values, valid = flow_errors(truth_rows.row(row), predicted_px)
            sums.add(values, valid, partitions)
            errors.append((values["error_px"].sum(), values["scored"].sum()))
            self.progress(stream, row + 1, len(matched))
        parts = tuple(flow_accuracy(part, totals) for part, totals in sums.totals().items())

        rate_hz = flow_rate_hz(stream)
        if without_depth:
            self.notes.append(
                f"{stream}: no depth frame at the start of {without_depth} of {len(matched)} intervals; these are not "
                "divided by depth, nor near edges of depth."
            )
        if self.truth.declared.flow_model == "scene" and not moving:
            self.notes.append(f"{stream}: objects move by themselves, and no labels say which pixels show them.")
        if parts and parts[0].mean_flow_px and parts[0].mean_predicted_flow_px:
            ratio = parts[0].mean_predicted_flow_px / parts[0].mean_flow_px
            if rate_hz > _SAME_RATIO**2 and rate_hz / _SAME_RATIO < ratio < rate_hz * _SAME_RATIO:
                self.notes.append(
                    f"{stream}: predicted flow is {ratio:.3g} times as long as true flow, as it is in px/s; flow is px over "
                    "its interval."
                )
        return FlowScore(
            stream=stream,
            rate_hz=rate_hz,
            fields=len(matched),
            predicted_fields=int(np.count_nonzero(matched >= 0)),
            parts=parts,
            over_time=errors_over_time(intervals_us, np.array(errors).reshape(-1, 2)),
        )

    def depth(self) -> DepthScore:
        """Score depth and disparity."""
        key = "path/depth"
        times_us, matched = self._matched("depth", key)
        truth_rows, predicted_rows = self._reader(key), RowReader(self.predicted, key, self.predicted.shape(key))
        absent = np.full(self.truth.layout.bindings[key].shape[1:], np.nan, np.float32)
        whole = whole_image(*absent.shape)
        sums, errors = ErrorSums(), []
        for row, place in enumerate(matched.tolist()):
            truth_m = truth_rows.row(row) / np.float32(MM_PER_M)
            predicted_m = predicted_rows.row(place) / np.float32(MM_PER_M) if place >= 0 else absent
            values, valid = depth_errors(truth_m, predicted_m)
            sums.add(values, valid, [whole, *self._depth_partitions(truth_m)])
            errors.append((values["disparity_error_per_m"].sum(), values["disparity_per_m"].sum()))
            self.progress("depth", row + 1, len(matched))
        parts = tuple(depth_accuracy(part, totals) for part, totals in sums.totals().items())
        log_ratio = parts[0].mean_log_error if parts else None
        if log_ratio is not None and abs(log_ratio + math.log(MM_PER_M)) < math.log(_SAME_RATIO):
            self.notes.append(f"depth: predictions are a thousandth of the truth, as they are in m; {key} is in mm.")
        return DepthScore(
            frames=len(matched),
            predicted_frames=int(np.count_nonzero(matched >= 0)),
            parts=parts,
            over_time=errors_over_time(times_us, np.array(errors).reshape(-1, 2)),
        )

    def pose(self) -> PoseScore:
        """Score poses."""
        times_us, matched = self._matched("pose", "path/pose/position")
        truth, predicted = (
            tuple(
                np.asarray(source.rows(f"path/pose/{part}", 0, count), np.float64)
                for part in ("position", "orientation")
            )
            for source, count in ((self.truth, len(matched)), (self.predicted, self.predicted.shape("path/pose/ts")[0]))
        )
        valid = _are_poses(*truth)
        scored = valid & (matched >= 0)
        scored[scored] = _are_poses(*predicted)[matched[scored]]
        places, rows = matched[scored], np.flatnonzero(scored)
        true_poses = truth[0][rows], so3.normalise(truth[1][rows])
        poses = predicted[0][places], so3.normalise(predicted[1][places])
        errors = []
        over_time: tuple[ErrorAtTime, ...] = ()
        if len(rows):
            alignments = [tuple(absolute_errors(true_poses, poses, alignment)) for alignment in _ALIGNMENTS]
            errors += [error for group in alignments for error in group]
            if not all(alignments):
                self.notes.append("pose: positions lie on a line, so that no alignment of both paths is determined.")
            # The second delta is the number of poses in a second: an error of one step depends on the rate.
            step_us = float(np.median(np.diff(times_us[rows]))) if len(rows) > 1 else 0.0
            deltas = dict.fromkeys((1, round(US_PER_S / step_us) if step_us > 0 else 1))
            errors += [error for delta in deltas for error in relative_errors(true_poses, poses, max(delta, 1))]
            distances_m = np.linalg.norm(poses[0] - true_poses[0], axis=1)
            over_time = errors_over_time(times_us[rows], np.column_stack([distances_m, np.ones(len(rows))]))
        noise = self.truth.declared.pose
        if noise and (noise.position_sigma_m or noise.rotation_sigma_rad):
            self.notes.append(
                f"pose: the true poses carry noise of {noise.position_sigma_m:.3g} m and "
                f"{math.degrees(noise.rotation_sigma_rad):.3g} deg per axis; errors of that size are no errors of the "
                "predictions."
            )
        return PoseScore(
            poses=int(np.count_nonzero(valid)),
            scored_poses=len(rows),
            coverage=share(len(rows), int(np.count_nonzero(valid))),
            normalised=tuple(normalised_errors(true_poses, poses)) if len(rows) else (),
            errors=tuple(errors),
            over_time=over_time,
        )

    def _matched(self, stream: str, key: str) -> tuple[Int64, Int64]:
        """Return the timestamps of the truth, and the row of the prediction of each; raises where they do not fit."""
        of = f"{stream} in {self.predicted.path}"
        times_us, shape = self._times_us(stream), self.truth.layout.bindings[key].shape
        predicted_shape = self.predicted.shape(key)
        if predicted_shape[1:] != shape[1:]:
            raise MisuseError(
                f"Expected {of} of {_size(shape)} as in the sequence, got {_size(predicted_shape)}; resize the predictions, "
                "and scale flow with them"
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

    def _times_us(self, stream: str) -> Int64:
        key = timestamps_of(stream)
        return file_times_us(self.truth, key, 0, self.truth.layout.bindings[key].rows)

    def _reader(self, key: str) -> RowReader:
        return RowReader(self.truth, key, self.truth.layout.bindings[key].shape)

    def _depth_m(self, time_us: int, size: tuple[int, ...]) -> NDArray[np.float32] | None:
        """Return the depth at an instant, m; None where there is no frame of this size."""
        rows = np.flatnonzero(self._depth_times_us == time_us)
        if self._depth is None or not len(rows):
            return None
        depth_m: NDArray[np.float32] = self._depth.row(int(rows[0])) / np.float32(MM_PER_M)
        return depth_m if depth_m.shape == size else None

    def _depth_partitions(self, depth_m: NDArray[np.float32]) -> list[Partition]:
        edges = [near_edges(depth_m, self._farthest_m)] if self._farthest_m else []
        return [by_depth(depth_m), *edges]


def errors_over_time(times_us: Int64, errors: NDArray[np.float64]) -> tuple[ErrorAtTime, ...]:
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
    for rows in np.array_split(order, min(MOST_POINTS, len(order)) or 1):
        if len(rows):
            error = errors[rows, 0].sum() / errors[rows, 1].sum()
            points.append(ErrorAtTime(int(times[rows[0], 0]), int(times[rows, -1].max()), float(error)))
    return tuple(points)


def _are_poses(positions: NDArray[np.float64], orientations_xyzw: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which rows (n,) are finite, with a quaternion that is a rotation when scaled."""
    lengths = np.linalg.norm(orientations_xyzw, axis=1)
    return np.isfinite(positions).all(axis=1) & np.isfinite(lengths) & (lengths > 0)


def _size(shape: Sequence[int]) -> str:
    """Return the size of the rows of a dataset, in words."""
    return f"{shape[2]} x {shape[1]} px" if len(shape) > 2 else f"{shape[1]} columns"
