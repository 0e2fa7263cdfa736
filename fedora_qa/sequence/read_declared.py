"""Read the declarations of a file: each attribute as a typed value, or as a problem."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import allowed
from fedora_qa.conventions import FORMAT_NAME, STANDARD_GRAVITY_M_S2
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.binding import Binding, canonical_rows, stored_dataset
from fedora_qa.layout.canonical import (
    ATTRIBUTES,
    PINHOLE,
    RECTIFY_MAP,
    AttributeSpec,
    attributes_of,
    is_dataset_key,
)
from fedora_qa.layout.decodable import LARGEST_IMAGE_PIXELS
from fedora_qa.layout.dialect import (
    DEPTH_RANGE,
    DISPARITY_TO_DEPTH,
    EVENT_MODEL,
    T_BODY_IMU,
    T_SECOND_DEPTH,
    UNKNOWN,
    VERTICAL,
)
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.folder import OpenFolder
from fedora_qa.layout.hdf5_objects import READ_ERRORS, RefusedError, find_object, text_attribute
from fedora_qa.layout.metadata import rounding_of
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.attributes import (
    READERS,
    ImpossibleError,
    MalformedError,
    read_attribute,
    short_repr,
    unusual_form,
)
from fedora_qa.sequence.declared import (
    Camera,
    DeclarationProblem,
    Declared,
    EventModel,
    ImuModel,
    Lens,
    PoseModel,
    StereoPair,
)

Values = Mapping[str, Any]

CAMERAS: Final = ("rgb", "depth", "events")
NEAREST_DEPTH_M: Final = 1e-6
"""Least valid depth, m: about the wavelength of light."""

FARTHEST_DEPTH_M: Final = 12_742_000.0
"""Largest valid depth, m: the diameter of the Earth."""

_COEFFICIENTS: Final = {"radtan": (4, 5), "equidistant": (4,)}
"""Numbers of coefficients that each model of a lens can have."""

_OWNERS: Final = tuple(dict.fromkeys(owner for owner, _ in ATTRIBUTES))
_LENS: Final = ("distortion_model", "distortion")


def read_declared(
    file: h5py.File | OpenFolder, layout: Layout, external_files: ExternalFiles | None = None
) -> Declared:
    """Read every attribute of the layout; attributes that cannot be used become problems.

    A group that is absent as a whole gives one problem with an empty ``name``. A required attribute that is absent, or
    any that is malformed, gives one problem each. Only the root of a file in the canonical dialect must carry
    ``format``. What the dialect or a file beside the sequence declares takes the place of an attribute; of a group that
    exists by such declarations alone, nothing more is required, except of a camera, which is of no use in part.

    Parameters
    ----------
    file
        The open file; of a folder all its HDF5 files, which carry no attributes of the layout.
    layout
        Paths of its objects.
    external_files
        Other files that it links to; None where these may not be read.

    Returns
    -------
    Declared
        Problems are in the order of the layout.
    """
    reader = _Reader(file, layout, external_files)
    values = {owner: reader.read(owner) for owner in _OWNERS}
    root = values[""] or {}
    flow, events = values["metadata/flow"], values["metadata/events"]
    imu, pose = values["metadata/imu"], values["metadata/pose"]
    event_model: EventModel | None = None
    # No default of a threshold: a guessed one would produce findings on correct data.
    if events is not None and {"model", "threshold_on", "threshold_off"} <= events.keys():
        event_model = EventModel(**{name: value for name, value in events.items() if name in EventModel.__slots__})
    imu_model: ImuModel | None = None
    if imu is not None:
        imu_model = ImuModel(
            gyro_noise_density=imu.get("gyro_noise_density", 0.0),
            accel_noise_density=imu.get("accel_noise_density", 0.0),
            gyro_bias_walk=imu.get("gyro_bias_walk", 0.0),
            accel_bias_walk=imu.get("accel_bias_walk", 0.0),
            gravity=imu.get("gravity", STANDARD_GRAVITY_M_S2),
            sampling=imu.get("sampling", "instant"),
        )
    cameras = reader.cameras(values)
    return Declared(
        cameras=cameras,
        events=event_model,
        imu=imu_model,
        pose=None if pose is None else PoseModel(pose.get("position_sigma", 0.0), pose.get("rotation_sigma", 0.0)),
        imu_lever_body_m=_lever_m(layout),
        has_vertical=VERTICAL not in layout.supplied,
        flow_model=None if flow is None else flow.get("model", "rigid"),
        depth_range_m=reader.depth_range_m(),
        rectify_map_px=reader.rectify_map_px(cameras.get("events")),
        stereo=_stereo(layout),
        transfer=(values["path/rgb"] or {}).get("transfer", "linear"),
        profile=root.get("profile"),
        sequence=root.get("sequence", ""),
        world=root.get("world", ""),
        illumination=root.get("illumination", ""),
        kind=root.get("kind"),
        units=reader.units(),
        problems=tuple(reader.problems),
    )


def _lever_m(layout: Layout) -> tuple[float, ...]:
    """Return where the IMU sits in the body, m; a matrix that is none has been refused with the stream."""
    made = layout.supplied.get(T_BODY_IMU)
    if made is None or made.problem or "imu" not in layout.streams:
        return 0.0, 0.0, 0.0
    return tuple(np.asarray(made.value, np.float64)[:3, 3].tolist())


def _stereo(layout: Layout) -> StereoPair | None:
    """Return the pair of cameras of disparity; a matrix that is none has been refused with the stream."""
    made, second = layout.supplied.get(DISPARITY_TO_DEPTH), layout.supplied.get(T_SECOND_DEPTH)
    if made is None or made.problem:
        return None
    Q = np.asarray(made.value, np.float64)
    # (X, Y, Z, W) = Q (x, y, d, 1), W = d / baseline and Z = f, but for a common factor (OpenCV, stereoRectify).
    if Q.shape != (4, 4) or not np.all(np.isfinite(Q)) or 0 in (Q[0, 0], Q[2, 3], Q[3, 2]) or Q[2, 2] != 0:
        return None
    factor = abs(float(Q[0, 0]))
    focal_px, baseline_m = abs(float(Q[2, 3])) / factor, factor / abs(float(Q[3, 2]))
    declared_m, declared_rounding_m = None, 0.0
    translation_m = np.empty(0) if second is None or second.problem else np.asarray(second.value, np.float64)[:3, 3:]
    if second is not None and translation_m.size == 3 and np.all(np.isfinite(translation_m)):
        declared_m = float(np.linalg.norm(translation_m))
        # t = R (R' t'' + t') + t: each rotation turns what is at most that far away, in three products a component.
        declared_rounding_m = 3.0 * (1.0 + declared_m) * (second.rounding or rounding_of(second.value))
    return StereoPair(
        focal_px=focal_px,
        baseline_m=baseline_m,
        declared_baseline_m=declared_m,
        focal_rounding_px=rounding_of(Q, Q[2, 3]) / factor,
        # b = 1 / c, so that db = b^2 dc.
        baseline_rounding_m=baseline_m**2 * rounding_of(Q, Q[3, 2]) / factor,
        declared_rounding_m=declared_rounding_m,
    )


class _Reader:
    """Reads owner by owner and keeps the problems in order."""

    def __init__(self, file: h5py.File | OpenFolder, layout: Layout, external_files: ExternalFiles | None) -> None:
        self.external_files = external_files
        self.file = file
        self.layout = layout
        self.problems: list[DeclarationProblem] = []

    def read(self, owner: str) -> Values | None:
        """Return the attributes of an object by name, or None where the object is absent."""
        binding = self.layout.bindings.get(owner)
        path = binding.path if binding else owner
        target = None
        try:
            if isinstance(self.file, h5py.File):
                target = find_object(self.file, path, self.external_files)
        except RefusedError as refused:
            self._problem(path, "", refused.cause, str(refused))
        holder = target if isinstance(target, h5py.Group | h5py.Dataset) else None
        specs = attributes_of(owner)
        supplied = {spec.name: made for spec in specs if (made := self.layout.supplied.get(_key_of(spec)))}
        if holder is None and not supplied:
            if not is_dataset_key(owner) and (owner or isinstance(self.file, h5py.File)):
                message = f"Expected the group /{owner}, got nothing there"
                if isinstance(self.file, OpenFolder) and (files := self.file.matched.missing_files(owner)):
                    message += f", because there is no {' and no '.join(files)} in the folder; supply it"
                self._problem(owner, "", "missing_stream", message)
            return None
        values: dict[str, Any] = {}
        is_unknown = False
        for spec in specs:
            made = supplied.get(spec.name)
            if made is not None and made.problem:
                self._problem(owner, spec.name, "unknown", made.problem)
                continue
            try:
                if made is not None:
                    value = READERS[spec.kind](made.value, spec)
                else:
                    value = read_attribute(holder, spec) if holder is not None else None
            except MalformedError as malformed:
                impossible = isinstance(malformed, ImpossibleError)
                cause, stream = malformed.cause, malformed.stream
                self._problem(owner, spec.name, cause, str(malformed), impossible=impossible, stream=stream)
                continue
            if _key_of(spec) == EVENT_MODEL and value == UNKNOWN:
                # Nobody states how the sensor responds, so that no threshold is required either.
                is_unknown = True
            elif value is not None:
                values[spec.name] = value
                form = unusual_form(holder, spec, value) if holder is not None and made is None else ""
                if form:
                    self._problem(owner, spec.name, "wrong_dtype", form, usable=True)
            # Files of other dialects carry no ``format`` at their root.
            elif (
                spec.required
                and not is_unknown
                and (holder is not None or owner.startswith("metadata/cameras/"))
                and (owner or self.layout.dialect_name == FORMAT_NAME)
            ):
                self._problem(owner, spec.name, "missing_stream", f"Expected {spec.meaning}, got no such attribute")
        return values

    def cameras(self, values: Mapping[str, Values | None]) -> dict[str, Camera]:
        """Return the cameras that are declared in full, without those whose images are too large for checks."""
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
            # A camera whose lens is not known must not be taken for a pinhole.
            lens = self._lens(f"metadata/cameras/{name}", given)
            if lens == UNKNOWN:
                continue
            cameras[name] = Camera(
                width=given["width"],
                height=given["height"],
                K=given["K"],
                T_body_camera=given["T_body_camera"],
                exposure_us=given.get("exposure_us", 0.0),
                model=given.get("camera_model", PINHOLE),
                lens=lens,
            )
        return cameras

    def _lens(self, owner: str, given: Values) -> Lens | Literal["unknown"] | None:
        """Return the distortion of a camera, None where it has none; ``unknown`` where the declaration is a problem."""
        if any(each.owner == owner and each.name in _LENS and not each.usable for each in self.problems):
            return UNKNOWN
        model, coefficients = given.get("distortion_model", "none"), given.get("distortion", ())
        if model == "none":
            if any(coefficients):
                models = " or ".join(map(repr, _COEFFICIENTS))
                message = (
                    f"Expected no coefficients of a lens without distortion_model, got {len(coefficients)}; declare "
                    f"distortion_model {models}, or remove distortion"
                )
                self._problem(owner, "distortion", "unknown", message)
                return UNKNOWN
            return None
        counts = _COEFFICIENTS[model]
        if len(coefficients) not in counts:
            message = (
                f"Expected {' or '.join(map(str, counts))} coefficients of the {model} model in OpenCV's order, got "
                f"{len(coefficients)}; declare distortion, or distortion_model 'none' for a lens without"
            )
            self._problem(owner, "distortion", "wrong_shape", message)
            return UNKNOWN
        # The radial-tangential model without coefficients is the pinhole; the equidistant one is not.
        return None if model == "radtan" and not any(coefficients) else Lens(model, coefficients)

    def depth_range_m(self) -> tuple[float, float] | None:
        """Return nearest and farthest valid depth, m, if declared."""
        binding, made = self.layout.bindings.get(DEPTH_RANGE), self.layout.supplied.get(DEPTH_RANGE)
        if binding is None and made is None:
            return None
        try:
            if made is not None:
                bounds_m = np.asarray(made.value, np.float64).reshape(-1) if not made.problem else np.empty(0)
                if len(bounds_m) != 2:
                    message = made.problem or f"Expected two depths, got {short_repr(made.value)}"
                    self._problem("metadata", "depth_range", "unknown", message)
                    return None
            elif binding is not None:
                bounds_m = canonical_rows(self._holding(binding), binding, 0, 2, 0)
            nearest, farthest = (float(bound) for bound in bounds_m)
        except (UnreadableRowsError, ValueError, TypeError) as error:
            self._problem("metadata", "depth_range", "unknown", str(error))
            return None
        # The comparison is False for NaN too.
        if not NEAREST_DEPTH_M <= nearest < farthest <= FARTHEST_DEPTH_M:
            bounds = f"{NEAREST_DEPTH_M:g} <= nearest < farthest <= {FARTHEST_DEPTH_M:g}"
            message = f"Expected {bounds} in metres, got {nearest:g} and {farthest:g}"
            # A range from zero, or without an end, is vague; one that is inverted, negative or NaN has no meaning.
            impossible = not 0 <= nearest < farthest
            self._problem("metadata", "depth_range", "unknown", message, impossible=impossible)
            return None
        return nearest, farthest

    def rectify_map_px(self, events: Camera | None) -> NDArray[np.float32] | None:
        """Return where the view of the depth camera has each pixel of the event camera, px, if stated."""
        binding = self.layout.bindings.get(RECTIFY_MAP)
        if binding is None or events is None:
            return None
        height, width = binding.shape[:2]
        if (width, height) != (events.width, events.height):
            message = (
                f"Expected a place for each of the {events.width} x {events.height} pixels of the event camera, got "
                f"{width} x {height}"
            )
            if (height, width) == (events.width, events.height):
                message += "; is it stored by x before y?"
            self._problem("metadata", "rectify_map", "wrong_shape", message)
            return None
        try:
            return canonical_rows(self._holding(binding), binding, 0, binding.rows, 0).astype(np.float32)
        except UnreadableRowsError as error:
            self._problem("metadata", "rectify_map", "unknown", str(error))
            return None

    def units(self) -> dict[str, str]:
        """Return the label ``units`` of each dataset that carries one."""
        labels: dict[str, str] = {}
        for key, binding in self.layout.bindings.items():
            if binding.members:  # the label is that of all members, which have several units
                continue
            # A label that cannot be read counts as absent.
            with suppress(*READ_ERRORS):
                file = self._holding(binding)
                label = text_attribute(stored_dataset(file, binding), "units") if file is not None else None
                if label is not None:
                    labels[key] = label
        return labels

    def _holding(self, binding: Binding) -> h5py.File | None:
        file = self.file if isinstance(self.file, h5py.File) else self.file.hdf5.get(binding.role)
        if file is None or binding.outside is not None:
            return None
        return self.external_files.holding(file, binding) if self.external_files else file

    def _problem(
        self,
        owner: str,
        name: str,
        cause: str,
        message: str,
        *,
        impossible: bool = False,
        usable: bool = False,
        stream: str = "metadata",
    ) -> None:
        cause_named = cause if allowed(cause, stream) else "unknown"
        self.problems.append(DeclarationProblem(owner, name, message, cause_named, impossible, usable, stream))


def _key_of(spec: AttributeSpec) -> str:
    return f"{spec.owner}/{spec.name}".lstrip("/")
