"""Read what a file declares about itself. No function here raises: whatever cannot be used becomes a problem."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

import h5py

from fedora_qa.causes import allowed
from fedora_qa.conventions import FORMAT_NAME, STANDARD_GRAVITY_M_S2
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.binding import Binding, canonical_rows, stored_dataset
from fedora_qa.layout.bounds import LARGEST_IMAGE_PIXELS
from fedora_qa.layout.canonical import ATTRIBUTES, DATASETS, attributes_of
from fedora_qa.layout.elsewhere import Elsewhere
from fedora_qa.layout.links import READ_ERRORS, RefusedError, find_object
from fedora_qa.layout.resolve import Layout
from fedora_qa.layout.stored_attribute import text_attribute
from fedora_qa.sequence.attributes import MalformedError, read_attribute
from fedora_qa.sequence.declared import Camera, DeclarationProblem, Declared, EventModel, ImuModel, PoseModel

Values = Mapping[str, Any]

CAMERAS: Final = ("rgb", "depth", "events")
NEAREST_DEPTH_M: Final = 1e-6
"""No light shows a surface that is nearer to a lens than about its wavelength."""

FARTHEST_DEPTH_M: Final = 12_742_000.0
"""Diameter of the Earth: what surfaces a camera above it can see lie nearer."""

_OWNERS: Final = tuple(dict.fromkeys(owner for owner, _ in ATTRIBUTES))


def read_declared(file: h5py.File, layout: Layout, elsewhere: Elsewhere | None = None) -> Declared:
    """Read every attribute of the layout.

    A group that is absent as a whole gives one problem with an empty ``name``; a required attribute that is absent,
    or any that is malformed, gives one of its own. Only the root of a file in the canonical dialect must carry
    ``format``.
    """
    reader = _Reader(file, layout, elsewhere)
    values = {owner: reader.read(owner) for owner in _OWNERS}
    flow = values["metadata/flow"]
    return Declared(
        cameras=reader.cameras(values),
        events=_event_model(values["metadata/events"]),
        imu=_imu_model(values["metadata/imu"]),
        pose=_pose_model(values["metadata/pose"]),
        flow_model=None if flow is None else flow.get("model", "rigid"),
        depth_range_m=reader.depth_range_m(),
        transfer=(values["path/rgb"] or {}).get("transfer", "linear"),
        profile=(values[""] or {}).get("profile"),
        units=reader.units(),
        problems=tuple(reader.problems),
    )


class _Reader:
    """Reads owner by owner and keeps the problems in order."""

    def __init__(self, file: h5py.File, layout: Layout, elsewhere: Elsewhere | None) -> None:
        self.elsewhere = elsewhere
        self.file = file
        self.layout = layout
        self.problems: list[DeclarationProblem] = []

    def read(self, owner: str) -> Values | None:
        """Return the attributes of an object by name, or None where the object is absent."""
        binding = self.layout.bindings.get(owner)
        holder = self._holder(binding.path if binding else owner)
        if holder is None:
            if owner not in DATASETS:
                self._problem(owner, "", "missing_stream", f"Expected the group /{owner}, got nothing there")
            return None
        values: dict[str, Any] = {}
        for spec in attributes_of(owner):
            try:
                value = read_attribute(holder, spec)
            except MalformedError as malformed:
                self._problem(owner, spec.name, malformed.cause, str(malformed))
                continue
            if value is not None:
                values[spec.name] = value
            # Files of other dialects carry no ``format`` at their root.
            elif spec.required and (owner or self.layout.dialect_name == FORMAT_NAME):
                self._problem(owner, spec.name, "missing_stream", f"Expected {spec.meaning}, got no such attribute")
        return values

    def cameras(self, values: Mapping[str, Values | None]) -> dict[str, Camera]:
        """Return the cameras that are declared in full, and not beyond what checks can hold an image of."""
        cameras = {}
        for name in CAMERAS:
            given = values[f"metadata/cameras/{name}"]
            # No defaults: a guessed camera would produce findings on correct data.
            if given is None or not {"width", "height", "K", "T_body_camera"} <= given.keys():
                continue
            if given["width"] * given["height"] > LARGEST_IMAGE_PIXELS:
                message = f"Expected {LARGEST_IMAGE_PIXELS} pixels at most, got {given['width']} x {given['height']}"
                self._problem(f"metadata/cameras/{name}", "width", "wrong_shape", message)
                continue
            cameras[name] = Camera(
                width=given["width"],
                height=given["height"],
                K=given["K"],
                T_body_camera=given["T_body_camera"],
                exposure_us=given.get("exposure_us", 0.0),
                model=given.get("camera_model", "pinhole"),
            )
        return cameras

    def depth_range_m(self) -> tuple[float, float] | None:
        """Return nearest and farthest valid depth, if declared."""
        binding = self.layout.bindings.get("metadata/depth_range")
        if binding is None:
            return None
        try:
            nearest, farthest = (float(bound) for bound in canonical_rows(self._holding(binding), binding, 0, 2, 0))
        except UnreadableRowsError as error:
            self._problem("metadata", "depth_range", "unknown", str(error))
            return None
        # The comparison is False for NaN too.
        if not NEAREST_DEPTH_M <= nearest < farthest <= FARTHEST_DEPTH_M:
            bounds = f"{NEAREST_DEPTH_M:g} <= nearest < farthest <= {FARTHEST_DEPTH_M:g}"
            message = f"Expected {bounds} in metres, got {nearest:g} and {farthest:g}"
            self._problem("metadata", "depth_range", "unknown", message)
            return None
        return nearest, farthest

    def units(self) -> dict[str, str]:
        """Return the label ``units`` of each dataset that carries one."""
        labels: dict[str, str] = {}
        for key, binding in self.layout.bindings.items():
            # A label that cannot be read counts as absent.
            with suppress(*READ_ERRORS):
                label = text_attribute(stored_dataset(self._holding(binding), binding), "units")
                if label is not None:
                    labels[key] = label
        return labels

    def _holding(self, binding: Binding) -> h5py.File:
        return self.elsewhere.holding(self.file, binding) if self.elsewhere else self.file

    def _holder(self, path: str) -> h5py.Group | h5py.Dataset | None:
        try:
            holder = find_object(self.file, path, self.elsewhere)
        except RefusedError as refused:
            self._problem(path, "", refused.cause, str(refused))
            return None
        return holder if isinstance(holder, h5py.Group | h5py.Dataset) else None

    def _problem(self, owner: str, name: str, cause: str, message: str) -> None:
        cause_named = cause if allowed(cause, "metadata") else "unknown"
        self.problems.append(DeclarationProblem(owner, name, message, cause_named))


def _event_model(given: Values | None) -> EventModel | None:
    if given is None or not {"model", "threshold_on", "threshold_off"} <= given.keys():
        return None
    return EventModel(**{name: value for name, value in given.items() if name in EventModel.__slots__})


def _imu_model(given: Values | None) -> ImuModel | None:
    if given is None:
        return None
    return ImuModel(
        gyro_noise_density=given.get("gyro_noise_density", 0.0),
        accel_noise_density=given.get("accel_noise_density", 0.0),
        gyro_bias_walk=given.get("gyro_bias_walk", 0.0),
        accel_bias_walk=given.get("accel_bias_walk", 0.0),
        gravity=given.get("gravity", STANDARD_GRAVITY_M_S2),
        sampling=given.get("sampling", "instant"),
    )


def _pose_model(given: Values | None) -> PoseModel | None:
    if given is None:
        return None
    return PoseModel(given.get("position_sigma", 0.0), given.get("rotation_sigma", 0.0))
