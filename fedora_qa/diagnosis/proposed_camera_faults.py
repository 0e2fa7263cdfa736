"""The faults of cameras that a trial undoes: focal lengths, principal points and mountings, with sizes from fits."""

from collections.abc import Collection, Iterator, Sequence
from itertools import islice
from math import copysign, hypot, isclose
from typing import Final

import numpy as np

from fedora_qa.checks.event_response.alignment import CameraErrorFits
from fedora_qa.diagnosis.declared_intrinsics import (
    centres_from_middle,
    film_focal_lengths,
    normalised_intrinsics,
    odd_centres,
    odd_intrinsics,
    opposite_focal_lengths,
    other_views,
    sizes_of_images,
    transposed,
    unequal_focal_lengths,
)
from fedora_qa.diagnosis.declared_mountings import mounting_units, odd_mounting
from fedora_qa.diagnosis.fitted_cause import Faults, FittedCause
from fedora_qa.diagnosis.measured_sizes import flow_vector
from fedora_qa.estimators.events.shift_field import (
    FOCAL_MODELS,
    ROTATION_MODELS,
    SHIFT_AND_FOCAL_MODELS,
    ShiftFieldFit,
    ShiftFieldModel,
)
from fedora_qa.faults import intrinsics, mountings
from fedora_qa.faults.fault import Vector3
from fedora_qa.views.flow_comparison import FlowParameterFit
from fedora_qa.views.flow_conventions import ConventionTrial

_ABOUT_ONE_AXIS: Final = 1.25
"""Largest ratio of a rotation to its largest component for the others to be taken for errors. The value is not derived;
a trial more costs little."""

_SATURATES: Final = 1.5
"""Least ratio of a fitted size to the length of a measured vector for the vector not to be a measurement of it: a shift
of 1 px may be fitted as 1.5 px. The value is not derived."""


_MOSTLY: Final = 0.5
"""Least share of what one shift of an image leaves that a focal length explains, for both to be tried together. The
value is not derived; a trial more costs little."""


def _suspected_cameras(fit: FittedCause) -> Sequence[str | None]:
    """Return the declared cameras that may be wrong, most suspected first; None stands for all of them.

    Depth, its flow and the poses agree where the depth camera is declared correctly, and colour and events agree where
    the other two are: which of the two holds states which camera is odd.
    """
    if fit.stream != "metadata":
        return (None,)
    subjects = {alarm.finding.code.split(".")[0] for alarm in fit.alarms}
    depth_agrees = not subjects & {"flow_geometry", "depth"}
    others_agree = "event_response" not in subjects
    if depth_agrees:
        return tuple(camera for camera in fit.facts.declared.cameras if camera != "depth")
    return ("depth", None) if others_agree else (None, *fit.facts.declared.cameras)


def _camera_errors(fit: FittedCause, models: Collection[ShiftFieldModel]) -> Iterator[ShiftFieldFit]:
    """Yield the errors of a camera that the shifts of events follow, those that explain most first."""
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    fits = {each: None for feature in features if isinstance(feature, CameraErrorFits) for each in feature.fits}
    if fit.stream == "metadata":
        yield from sorted((each for each in fits if each.model in models), key=lambda each: -each.beyond_shift)


def focal_length(fit: FittedCause) -> Faults:
    """Yield focal lengths: those of improbable declarations first, then those that edges or flow fit."""
    if fit.stream == "metadata":
        yield from opposite_focal_lengths(fit.facts)
        yield from normalised_intrinsics(fit.facts)
        yield from film_focal_lengths(fit.facts)
        yield from sizes_of_images(fit.facts)
        yield from other_views(fit.facts)
        yield from unequal_focal_lengths(fit.facts)
    for best in islice(_camera_errors(fit, FOCAL_MODELS), 1):
        # Events whose image is wider by k: f' = f / (1 + k) of the event camera, or f' = f (1 + k) of that of colour.
        wider = [1 + gain for gain in best.focal_gains]
        for name, along in (("events", [1 / gain for gain in wider]), ("rgb", wider)):
            columns_percent, rows_percent = (100 * (factor - 1) for factor in along)
            yield intrinsics.FocalLength("metadata", columns_percent, name, rows_percent)
    for camera in _suspected_cameras(fit):
        yield intrinsics.FocalLength(fit.stream, fit.size, camera)


def principal_point(fit: FittedCause) -> Faults:
    """Yield principal points: those of improbable declarations first, then the fitted displacement."""
    if fit.stream == "metadata":
        if (by_transposing := transposed(fit.facts)).from_centre_px:
            yield by_transposing
        yield from centres_from_middle(fit.facts)
        yield from odd_intrinsics(fit.facts)
        yield from odd_centres(fit.facts)
    for best in _camera_errors(fit, SHIFT_AND_FOCAL_MODELS):
        if best.beyond_shift > _MOSTLY:
            right_px, down_px, gain = best.parameters
            # Events lie at f X + c, and where f' X + c' are declared: k = f / f' - 1, and the shift is c - c'.
            yield intrinsics.IntrinsicsOfAnotherImage("events", 100 * (1 / (1 + gain) - 1), -right_px, -down_px)
    u, v = fitted_vector(fit) or flow_vector("centre", ("u", "v"), fit.stream, fit.results)
    along_axes = ((fit.size, 0.0), (0.0, fit.size))
    for camera in _suspected_cameras(fit):
        for columns_px, rows_px in ((u, v),) if _has_that_size((u, v), fit.size) else along_axes:
            yield intrinsics.PrincipalPointShift(fit.stream, columns_px, rows_px, camera)


def mounting(fit: FittedCause) -> Faults:
    """Yield rotations of a camera: the one that is declared apart from the others first, then the fitted ones."""
    if fit.stream == "metadata" and (odd := odd_mounting(fit.facts)) is not None:
        yield odd
    for best in _camera_errors(fit, ROTATION_MODELS):
        # Events lie where the rotation moves the rays: R' = R Exp(w) of the event camera, or its inverse of colour.
        x_deg, y_deg, z_deg = (float(angle) for angle in np.rad2deg(best.parameters))
        yield mountings.MountingRotation("metadata", (x_deg, y_deg, z_deg), "events")
        yield mountings.MountingRotation("metadata", (-x_deg, -y_deg, -z_deg), "rgb")
    for turned in _turned_mountings(fit):
        for camera in _suspected_cameras(fit):
            yield mountings.MountingRotation(fit.stream, turned, camera)
    names = ("pitch", "yaw", "roll")
    if fit.stream == "metadata":
        yield from _turned_frames(flow_vector("mounting", names, "flow", fit.results), fit.size)
    pitch, yaw, roll = fitted_vector(fit) or flow_vector("mounting", names, fit.stream, fit.results)
    about_axes = ((fit.size, 0.0, 0.0), (0.0, fit.size, 0.0), (0.0, 0.0, fit.size))
    for camera in _suspected_cameras(fit):
        for rotation_deg in ((pitch, yaw, roll),) if _has_that_size((pitch, yaw, roll), fit.size) else about_axes:
            yield mountings.MountingRotation(fit.stream, rotation_deg, camera)


def _turned_frames(of_flow_deg: Sequence[float], size_deg: float) -> Faults:
    """Yield the rotations of the colour camera that deviate from its frames as a turned camera of flow would.

    About the axis of the largest component first where the others are small, since these are mostly errors.
    """
    x_deg, y_deg, z_deg = of_flow_deg
    if not _has_that_size(of_flow_deg, size_deg) or not any(of_flow_deg):
        return
    largest = max(of_flow_deg, key=abs)
    if hypot(*of_flow_deg) < _ABOUT_ONE_AXIS * abs(largest):
        x, y, z = (angle if angle == largest else 0.0 for angle in of_flow_deg)
        yield mountings.MountingRotation("metadata", (x, y, z), "rgb")
    yield mountings.MountingRotation("metadata", (x_deg, y_deg, z_deg), "rgb")


def mounting_lever_arm(fit: FittedCause) -> Faults:
    """Yield displacements of the cameras on the body: other units of it, and the one that flow fits to its motion."""
    yield from mounting_units(fit.facts)
    if arm := fitted_vector(fit):
        forward_m, left_m, up_m = arm
        for camera in _suspected_cameras(fit):
            yield mountings.MountingLeverArm((forward_m, left_m, up_m), camera)


def _turned_mountings(fit: FittedCause) -> Iterator[Vector3]:
    """Yield the rotation by which flow and depth move as the poses do, of the field that follows it most closely.

    The camera with which flow was made is turned against the declared one as far as that is against it, the other way.
    """
    trials = [feature for alarm in fit.alarms for feature in alarm.statistic.features
              if isinstance(feature, ConventionTrial) and feature.transform == "turned_mounting"]  # fmt: skip
    if trials and (fit.stream == "metadata" or fit.family == "flow"):
        sign = 1.0 if fit.stream == "metadata" else -1.0
        x_deg, y_deg, z_deg = (sign * angle for angle in max(trials, key=lambda trial: trial.removed_share).components)
        yield x_deg, y_deg, z_deg


def fitted_vector(fit: FittedCause) -> tuple[float, ...]:
    """Return the error of flow against depth and poses of which the fitted size is the norm; () if it is of none."""
    for feature in (feature for alarm in fit.alarms for feature in alarm.statistic.features):
        if (
            isinstance(feature, FlowParameterFit)
            and feature.parameter == fit.cause
            and isclose(abs(feature.value), abs(fit.size))
        ):
            # The declared camera lacks what the camera of the flow has in excess.
            sign = copysign(1.0, feature.value * fit.size)
            return tuple(sign * component for component in feature.components)
    return ()


def _has_that_size(vector: Sequence[float], size: float) -> bool:
    """Whether a measured vector is long enough for a fitted size; else another check fitted it, along one axis."""
    return _SATURATES * hypot(*vector) >= abs(size)
