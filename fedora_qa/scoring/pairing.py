"""A sequence and predictions of it, both open: which rows belong together, and parts of images by the true depth."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.scoring.error_sums import Partition, by_depth, near_edges
from fedora_qa.scoring.predictions import Predictions, RowReader, canonical_shape, matched_rows
from fedora_qa.sequence.sequence import Sequence as OpenSequence
from fedora_qa.sequence.sequence import file_times_us

Float32 = NDArray[np.float32]
Int64 = NDArray[np.int64]


class PairedSequence:
    """The truth and its predictions.

    Attributes
    ----------
    truth, predicted
        Both open.
    notes
        Remarks for the reader of the score.
    """

    def __init__(self, truth: OpenSequence, predicted: Predictions) -> None:
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
        key
            Its dataset of values.

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

    def depth_at(self, time_us: int, size: Sequence[int]) -> Float32 | None:
        """Return the true depth at an instant, m; None where there is no frame, or it has another size (H, W)."""
        rows = np.flatnonzero(self._depth_times_us == time_us)
        if self._depth is None or not len(rows):
            return None
        depth_m = depth_in_m(self._depth.row(int(rows[0])))
        return depth_m if depth_m.shape == tuple(size) else None

    def _times_us(self, stream: str) -> Int64:
        key = timestamps_of(stream)
        return file_times_us(self.truth, key, 0, self.truth.layout.bindings[key].rows)


def depth_in_m(depth_mm: NDArray[Any]) -> Float32:
    """Return depth in m."""
    return np.asarray(depth_mm, np.float32) / np.float32(MM_PER_M)


def _size(shape: Sequence[int]) -> str:
    """Return the size of the rows of a dataset, in words."""
    return f"{shape[2]} x {shape[1]} px" if len(shape) > 2 else f"{shape[1]} columns"
