"""Faults of the axes in which vectors, orientations and the map that rectifies events are written."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import SAME_AXES
from fedora_qa.faults.fault import (
    KEYS_OF_SENSORS,
    Fault,
    InapplicableError,
    Matrix3,
    RowRange,
    Sensor,
    in_rows,
    streams_in,
    value_keys,
)
from fedora_qa.geometry import so3
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

Float64 = NDArray[np.float64]

_POSITION, _ORIENTATION = "path/pose/position", "path/pose/orientation"


@dataclass(frozen=True, slots=True)
class VectorAxes:
    """Vectors are written in other axes: ``v' = axes v``.

    Attributes
    ----------
    stream
        ``imu`` (both sensors), ``pose`` (positions and orientations), or flow (the third axis has no influence).
    axes
        Orthogonal matrix, for ``pose`` of the world.
    body_axes
        Orthogonal matrix of the body, only for ``pose``: ``R' = axes R body_axes^T``.
    turns_orientations
        Whether orientations are written in the axes too. If not, only positions are.
    cause
        ``frame_convention`` or ``axes_swapped``.
    rows
        The rows in the other axes; None: all.
    sensors
        Of ``imu``: whose vectors are in the other axes.
    """

    stream: str
    axes: Matrix3
    body_axes: Matrix3 = SAME_AXES
    turns_orientations: bool = True
    cause: Literal["frame_convention", "axes_swapped"] = "frame_convention"
    rows: RowRange | None = None
    sensors: tuple[Sensor, ...] = ("gyro", "accelerometer")
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Write vectors in the other axes."""
        description = f"the axes of {self.stream} follow another convention"
        return self._turned(facts, description, inverted=False)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Write vectors in the axes of the format: the inverse of an orthogonal matrix is its transpose."""
        description = f"the axes of {self.stream} back to the convention"
        return self._turned(facts, description, inverted=True)

    def _turned(self, facts: Facts, description: str, *, inverted: bool) -> Fault:
        keys, axes = value_keys(facts, self.stream), np.array(self.axes)
        if self.stream not in ("imu", "pose"):
            axes = axes[:2, :2]
        turn = in_rows(lambda vectors: _times_vectors(axes.T if inverted else axes, vectors), self.rows)
        if self.stream == "imu":
            streams_in(facts, self.stream)
            return Fault(description, {KEYS_OF_SENSORS[sensor]: turn for sensor in self.sensors})
        if self.stream != "pose":
            return Fault(description, dict.fromkeys(keys, turn))
        if not self.turns_orientations:
            return Fault(description, {_POSITION: turn})
        body_axes = np.array(self.body_axes)
        signs = np.sign(np.linalg.det(axes)), np.sign(np.linalg.det(body_axes))
        if signs[0] != signs[1]:
            raise InapplicableError("Expected axes of world and body of the same handedness, got different ones")
        # Two mirrorings are a rotation: (-A) R (-B)^T = A R B^T with -A and -B proper.
        left, right = (so3.quaternions_from_matrices(signs[0] * matrix) for matrix in (axes, body_axes.T))
        if inverted:
            # Inverses of these quaternions: those of the transposed matrices may have the opposite sign.
            left, right = so3.inverse(left), so3.inverse(right)

        def rotated(q: NDArray[Any]) -> NDArray[Any]:
            return so3.compose(so3.compose(left, q), right)

        return Fault(description, {_POSITION: turn, _ORIENTATION: in_rows(rotated, self.rows)})


def _times_vectors(axes: Float64, vectors: NDArray[Any]) -> NDArray[Any]:
    """Return ``axes v`` of vectors (..., n). A signed permutation moves NaN with its component, and rounds nothing."""
    if np.all(np.count_nonzero(axes, axis=-1) == 1):
        source = np.argmax(axes != 0, axis=-1)
        return np.asarray(vectors[..., source] * axes[np.arange(len(axes)), source]).astype(vectors.dtype)
    return np.asarray(vectors @ axes.T).astype(vectors.dtype)


@dataclass(frozen=True, slots=True)
class RectificationAxes:
    """Two axes of the map that rectifies events are exchanged.

    Attributes
    ----------
    exchanged
        ``coordinates``: entries are y before x; ``pixels``: the map of a square sensor is stored by x before y.
    """

    exchanged: Literal["coordinates", "pixels"] = "coordinates"
    cause: ClassVar[str] = "axes_swapped"
    stream: ClassVar[str] = "metadata"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange the axes."""
        return self._altered(facts, f"the {self.exchanged} of rectify_map are exchanged")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange the axes once more."""
        return self._altered(facts, f"the {self.exchanged} of rectify_map exchanged back")

    def _altered(self, facts: Facts, description: str) -> Fault:
        map_px = facts.declared.rectify_map_px
        if map_px is None:
            raise InapplicableError("Expected a map that rectifies events, got none")
        if self.exchanged == "pixels" and map_px.shape[0] != map_px.shape[1]:
            raise InapplicableError("Expected a square event camera to exchange the pixels of its map, got another")
        altered_px = map_px[..., ::-1] if self.exchanged == "coordinates" else map_px.swapaxes(0, 1)
        return Fault(description, declared=replace(facts.declared, rectify_map_px=altered_px))
