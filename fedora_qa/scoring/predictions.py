"""What a learner predicts: streams in canonical keys of an HDF5 file, or flow as a folder of PNG images as DSEC has it.

Every problem of predictions is a ``MisuseError``: unlike a sequence, they are not what is judged.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any, Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError, UnreadableFileError, UnreadableRowsError
from fedora_qa.layout.canonical import is_flow_stream, timestamps_of
from fedora_qa.layout.conversions import Conversion, converted
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.sequence.sequence import Sequence, file_times_us, open_sequence
from fedora_qa.sources.images import Images, images_of, number_in
from fedora_qa.sources.source import SourceError
from fedora_qa.sources.text import number_table

Int64 = NDArray[np.int64]

PredictionsForm = Literal["canonical", "dsec"]

DSEC_STREAM: Final = "flow/10hz"
"""DSEC predicts flow over about 0.1 s."""

_IMAGE_FOLDERS: Final = ("", "forward", "optical_flow/forward", "flow/forward")
_TIMES: Final = "forward_timestamps.txt"

_BLOCK_BYTES: Final = 64 << 20
"""Most bytes of rows that are read together, unless a single row has more."""

_SAME_INSTANT_US: Final = 1
"""Timestamps of one instant may differ so much by rounding to whole us."""


class Predictions(Protocol):
    """Predictions of streams by row."""

    path: Path
    streams: frozenset[str]
    others: tuple[str, ...]

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the shape of a dataset, rows first."""
        ...

    def times_us(self, stream: str) -> Int64 | None:
        """Return the timestamps (n,) of rows, (n, 2) of intervals, us on the clock of the file; None: not stated."""
        ...

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows in canonical units; raises ``MisuseError`` where they cannot be decoded."""
        ...

    def chunk_rows(self, key: str) -> int:
        """Return how many rows are stored together."""
        ...


class FilePredictions:
    """An HDF5 file in canonical keys; attributes and methods as of ``Predictions``."""

    def __init__(self, path: Path, sequence: Sequence) -> None:
        self.path = path
        self._sequence = sequence
        layout = sequence.layout
        self.streams = frozenset(stream for stream in layout.streams if can_be_scored(stream))
        self.others = tuple(sorted(layout.streams - self.streams))
        # A dataset that is there, and is of no use, must not be taken for one that was not predicted.
        for problem in layout.problems:
            if problem.stream in layout.absent and can_be_scored(problem.stream):
                raise MisuseError(f"{problem.message}, in {path}; write the predictions as the format has them")

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the shape of a dataset."""
        with _readable(self.path):
            return canonical_shape(self._sequence, key)

    def times_us(self, stream: str) -> Int64 | None:
        """Return the timestamps of a stream."""
        key = timestamps_of(stream)
        with _readable(self.path):
            return file_times_us(self._sequence, key, 0, self.shape(key)[0])

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows."""
        with _readable(self.path):
            return self._sequence.rows(key, start, stop)

    def chunk_rows(self, key: str) -> int:
        """Return how many rows are stored together."""
        return self._sequence.chunk_rows(key)


class FolderPredictions:
    """A folder of PNG images with flow in 16 bits; attributes and methods as of ``Predictions``.

    Source: https://dsec.ifi.uzh.ch/optical-flow-submission-format. The times lie in ``forward_timestamps.txt`` in the
    folder or beside it, or in the only ``.csv`` file in it, whose third column is the number in the name of the image.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.streams = frozenset({DSEC_STREAM})
        self.others: tuple[str, ...] = ()
        for inside in _IMAGE_FOLDERS:
            folder = path / inside
            names = [image.name for image in folder.glob("*.png")] if folder.is_dir() else []
            if names:
                break
        else:
            raise MisuseError(f"Expected PNG images of flow in {path}, got none; write one for each interval")
        with _readable(path):
            self._images = images_of(folder, names)
        form = self._images.form
        if len(form.shape) != 3 or form.shape[2] != 3 or form.dtype != "uint16":
            raise MisuseError(
                f"Expected flow in {folder} as 16-bit PNG of three channels (u, v, valid), got {form}; encode it as "
                "DSEC does"
            )
        listed = list(folder.glob("*.csv"))
        tables = [folder / _TIMES, folder.parent / _TIMES, *(listed if len(listed) == 1 else ())]
        table = next((table for table in tables if table.is_file()), None)
        self._times_us = None if table is None else _image_times_us(table, self._images)

    def shape(self, key: str) -> tuple[int, ...]:
        """Return the shape of the flow: the third channel of an image is validity."""
        return (*self._images.shape[:3], 2)

    def times_us(self, stream: str) -> Int64 | None:
        """Return the intervals of the images."""
        return self._times_us

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Decode images."""
        with _readable(self.path):
            return converted(self._images.rows(start, stop), key, Conversion("flow16"))

    def chunk_rows(self, key: str) -> int:
        """Return one image."""
        return 1


class RowReader:
    """Rows of a dataset one by one, decoded together where they are stored together."""

    def __init__(self, source: Predictions | Sequence, key: str, shape: tuple[int, ...]) -> None:
        self._source = source
        self._key = key
        self._count = shape[0]
        most = max(1, _BLOCK_BYTES // max(8 * prod(shape[1:]), 1))
        self._together = min(source.chunk_rows(key), most)
        self._first, self._block = 0, np.empty(0)

    def row(self, place: int) -> NDArray[Any]:
        """Return a row in canonical units."""
        if not self._first <= place < self._first + len(self._block):
            self._first = place - place % self._together
            self._block = self._source.rows(self._key, self._first, min(self._first + self._together, self._count))
        row: NDArray[Any] = self._block[place - self._first]
        return row


def canonical_shape(sequence: Sequence, key: str) -> tuple[int, ...]:
    """Return the shape of a dataset, rows first, as rows are returned; raises ``UnreadableRowsError``."""
    binding = sequence.layout.bindings[key]
    if not binding.rows:
        return (0, *binding.shape[1:])
    return (binding.rows, *sequence.rows(key, 0, 1).shape[1:])


def can_be_scored(stream: str) -> bool:
    """Whether there are metrics of a stream."""
    return stream in {"depth", "pose"} or is_flow_stream(stream)


@contextmanager
def open_predictions(path: Path, form: PredictionsForm | None) -> Iterator[Predictions]:
    """Open predictions until the block ends.

    Parameters
    ----------
    path
        An HDF5 file in canonical keys, or a folder of images.
    form
        Which of both it is; None: as it lies there.

    Raises
    ------
    MisuseError
        There is no such file, it cannot be opened, or it holds nothing that can be scored.
    """
    if form == "dsec" and not path.is_dir():
        raise MisuseError(f"Expected a folder of PNG images with --format dsec, got {path}; give the folder")
    if form == "canonical" and path.is_dir():
        raise MisuseError(f"Expected an HDF5 file with --format canonical, got the folder {path}; give the file")
    if path.is_dir():
        yield FolderPredictions(path)
        return
    try:
        sequence = open_sequence(path, load_dialect("fedora"))
    except UnreadableFileError as error:
        raise MisuseError(f"{error} ({path}); write the predictions again") from error
    with sequence:
        predictions = FilePredictions(path, sequence)
        if not predictions.streams:
            raise MisuseError(
                f"Expected predictions at path/flow/<rate>hz, path/depth or path/pose in {path}, got none; write them "
                "at the keys of the format"
            )
        yield predictions


def matched_rows(truth_us: Int64, predicted_us: Int64, of: str) -> Int64:
    """Return which row of the predictions (n,) is of each row of the truth; -1 where there is none.

    Parameters
    ----------
    truth_us, predicted_us
        (n,) and (m,) timestamps, or (n, 2) and (m, 2) intervals, us on the same clock, in any order.
    of
        The stream and where its predictions lie, for messages.

    Raises
    ------
    MisuseError
        A prediction is at no timestamp of the truth, or two are at one.
    """
    truth, predicted = truth_us.reshape(len(truth_us), -1), predicted_us.reshape(len(predicted_us), -1)
    order = np.argsort(truth[:, 0], kind="stable")
    # The first start that is not earlier than the prediction's by more than rounding.
    places = np.searchsorted(truth[order, 0], predicted[:, 0] - _SAME_INSTANT_US)
    fits = places < len(truth)
    rows = order[places[fits]]
    fits[fits] = np.all(np.abs(truth[rows] - predicted[fits]) <= _SAME_INSTANT_US, axis=1)
    if not fits.all():
        first = int(np.argmin(fits))
        raise MisuseError(
            f"Expected predictions of {of} at timestamps of the sequence, which has {_span(truth)}, got "
            f"{np.count_nonzero(~fits)} of {len(fits)} at others, the first at {_instant(predicted[first])}; copy the "
            "timestamps from the sequence"
        )
    matched = np.full(len(truth), -1, np.int64)
    matched[rows] = np.arange(len(rows))
    distinct = len(np.unique(rows))
    if distinct < len(rows):
        raise MisuseError(
            f"Expected one prediction of {of} for each timestamp, got {len(rows)} at {distinct}; keep one of each"
        )
    return matched


def _span(times_us: Int64) -> str:
    return f"{len(times_us)} from {times_us.min()} to {times_us.max()} us" if times_us.size else "none"


def _instant(times_us: Int64) -> str:
    return f"{' to '.join(map(str, times_us.tolist()))} us"


def _image_times_us(table: Path, images: Images) -> Int64:
    """Return the intervals (n, 2) of n images, in the order of the images."""
    with _readable(table):
        source = number_table(table)
        numbers = source.rows(0, source.shape[0])
    if numbers.dtype.kind != "i" or numbers.shape[1] not in {2, 3}:
        raise MisuseError(
            f"Expected start and end in whole us, and perhaps the number of the image, for each image in {table}, got "
            f"{numbers.shape[1]} columns of {numbers.dtype}; write whole numbers"
        )
    if numbers.shape[1] == 3:
        lines = {int(number): place for place, number in enumerate(numbers[:, 2])}
        in_names = (number_in(name) for name in images.names)
        places = [-1 if number is None else lines.get(int(number), -1) for number in in_names]
        if -1 in places:
            name = images.names[places.index(-1)]
            raise MisuseError(f"Expected the number of each image in {table}, got none for {name}; name images by it")
        return np.asarray(numbers[places, :2])
    if len(numbers) != len(images.names):
        raise MisuseError(
            f"Expected a line for each of {len(images.names)} images in {table}, got {len(numbers)}; write one for each"
        )
    return np.asarray(numbers)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Raise ``MisuseError`` where what is read of predictions cannot be."""
    try:
        yield
    except (UnreadableRowsError, SourceError) as error:
        raise MisuseError(f"{error}, in {path}; write the predictions again") from error
    except OSError as error:
        raise MisuseError(f"Expected predictions that can be read, got {error.strerror or error}: {path}") from error
