"""Hypotheses for declared cameras whose numbers are improbable, as causes of whatever depends on these cameras.

K may be transposed, or of an image of another size, have focal lengths in millimetres or of the opposite sign, or have
a principal point apart from the others; positions may be in another unit, and one camera of a rig may look elsewhere
than the others. Each such declaration states its own correction, which a trial tests.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import permutations
from math import atan, hypot, log, sqrt, tan
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.checks.metadata.cameras import convention_offset_px
from fedora_qa.conventions import FRD_FROM_FLU, R_BODY_OPTICAL, SAME_AXES
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.faults.fault import Matrix3, signed_length
from fedora_qa.faults.intrinsics import (
    FilmFocalLength,
    FocalLength,
    IntrinsicsOfAnotherImage,
    IntrinsicsOfSize,
    IntrinsicsOfSizes,
    PrincipalPointFromMiddle,
    PrincipalPointShift,
    TransposedIntrinsics,
    is_transposed,
)
from fedora_qa.faults.mountings import CameraAxes, InvertedMounting, MountingRotation, MountingUnit
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.camera_axes import AXES_AGREE, CENTRES_AGREE_M, is_about_parallel

_CAMERAS_OF_SUBJECT: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {
        "flow_geometry": frozenset({"depth"}),
        "depth": frozenset({"depth"}),
        "alignment": frozenset({"rgb", "depth", "events"}),
        "event_response": frozenset({"rgb", "events"}),
        "flow_photometric": frozenset({"rgb", "depth"}),
    }
)
"""Cameras by which the checks of a subject compare streams."""

_WITH_PARALLAX: Final = frozenset({"flow_geometry", "depth"})
"""Subjects in which the position of a camera on the body takes part."""

_FARTHEST_M: Final = 2.0
"""Distance of a camera from the origin of its body, m, above which another unit is tried. The value is not derived:
flying bodies and their sensor heads are smaller, and a trial decides."""

_WIDEST: Final = 4.0
"""Largest ratio of the longer side of an image to the focal length: the shortest focal length of a lens that images
straight lines as such is 9 mm, for film of 36 mm, which is a view of 127 degrees."""

_FILMS_MM: Final = (36.0, 20.955, 23.76)
"""Longer sides of films for which focal lengths are given in mm: of 35 mm photography and Blender; of USD and Isaac
Sim; of Unreal."""

_SAME_VIEW: Final = 1e-3
"""Largest relative difference of the tangents of two views that are equal: focal lengths are stored with four digits at
least."""

_OPPOSITE_PERCENT: Final = -200.0
"""Excess of a focal length that has the opposite sign."""

_ROUND_DEG: Final = 0.5
_FEWEST_OTHERS: Final = 2
"""Cameras that must be alike for another one to be odd: of two that differ either may be."""

_SAME: Final = 1e-7
"""Relative tolerance of round numbers: declared numbers are float64, and numbers with few digits rarely occur by
chance."""

_FROM_MIDDLE: Final = 0.2
"""Largest distance of a principal point from the middle of its image, in halves of the image. The value is not derived:
lenses are centred to a tenth of the width, and a trial decides."""

_SHAPES: Final = 16 / 9 / (5 / 4)
"""Largest ratio of two shapes of images: the widest and the narrowest that are common."""

_RESIZINGS: Final = tuple(factor * 2.0**power for power in range(-2, 6) for factor in (1.0, 1.5))
"""Ratios by which images are commonly resized: halves, and halves of three."""

_UNITS: Final = (1000.0, 100.0)
"""Declared over correct lengths: millimetres, centimetres."""


def of_declared_cameras(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the improbable declarations of the cameras on which a finding depends, as its causes."""
    subject = alarm.finding.code.partition(".")[0]
    names = _CAMERAS_OF_SUBJECT.get(subject, frozenset()) & facts.declared.cameras.keys()
    hypotheses: list[Hypothesis] = []
    for name in sorted(names):
        if is_transposed(facts.declared.cameras[name].K):
            hypotheses.append(transposed_hypothesis(facts))
        of_size = {fault: support_of_resizing(facts, fault.camera) for fault in resized_images(facts)}
        of_size |= dict.fromkeys(other_sizes(facts), support("metadata.of_another_size"))
        hypotheses += [
            Hypothesis("intrinsics_focal", "metadata", supported, fault.magnitude, "percent")
            for fault, supported in of_size.items()
            if fault.camera == name
        ]
    hypotheses += [
        Hypothesis("intrinsics_centre", "metadata", support("metadata.centre_from_middle"), fault.magnitude, "px")
        for fault in centres_from_middle(facts)
        if names & set(fault.names)
    ]
    films = [fault for fault in film_focal_lengths(facts) if names & set(fault.names)]
    hypotheses += [
        Hypothesis("intrinsics_focal", "metadata", support("metadata.view_too_wide"), fault.magnitude, "percent")
        for fault in films[:1]
    ]
    hypotheses += [
        Hypothesis("intrinsics_focal", "metadata", support("metadata.focal_length_not_positive"), fault.magnitude,
                   "percent")
        for fault in opposite_focal_lengths(facts)
        if fault.camera is None or fault.camera in names
    ]  # fmt: skip
    hypotheses += [
        Hypothesis(
            "intrinsics_focal", "metadata", support("metadata.view_by_wrong_formula"), fault.magnitude, "percent"
        )
        for fault in other_views(facts)
        if fault.camera in names
    ]
    hypotheses += [
        Hypothesis("intrinsics_focal", "metadata", support("metadata.pixels_not_square"), fault.magnitude, "percent")
        for fault in unequal_focal_lengths(facts)[:1]
        if fault.camera in names
    ]
    inverted = [fault.camera for fault in inverted_mountings(facts)]
    if names & set(inverted):
        hypotheses.append(Hypothesis("frame_convention", "metadata", support("metadata.inverted_mounting")))
    if subject in _WITH_PARALLAX and names and mountings_of_other_bodies(facts):
        hypotheses.append(Hypothesis("frame_convention", "metadata", support("metadata.axes_of_another_body")))
    odd = odd_mounting(facts)
    # An inverse explains the position as well.
    if odd is not None and odd.camera in names and odd.camera not in inverted:
        of_odd = support("metadata.odd_mounting")
        hypotheses.append(Hypothesis("extrinsic_rotation", "metadata", of_odd, odd.magnitude, "deg"))
    # The first of the units is the commonest.
    units = mounting_units(facts) if names and subject in _WITH_PARALLAX else ()
    hypotheses += [
        Hypothesis("lever_arm", "metadata", support("metadata.mounting_too_far"), fault.magnitude, "m")
        for fault in units[:1]
    ]
    return tuple(dict.fromkeys(hypotheses))


def transposed_hypothesis(facts: Facts) -> Hypothesis:
    """Return the principal points at 0, 0 of cameras with a transposed K as a cause."""
    size_px = transposed(facts).magnitude
    return Hypothesis("intrinsics_centre", "metadata", support("metadata.transposed_K"), size_px, "px")


def transposed(facts: Facts) -> TransposedIntrinsics:
    """Return the fault by which K is transposed, with the largest displacement of a principal point."""
    cameras = [camera for camera in facts.declared.cameras.values() if is_transposed(camera.K)]
    # The principal point stands in the last row.
    centres_px = (signed_length((-camera.K[2, 0], -camera.K[2, 1])) for camera in cameras)
    return TransposedIntrinsics(min(centres_px, default=0.0))


def other_sizes(facts: Facts) -> tuple[IntrinsicsOfSize, ...]:
    """Return the cameras whose K may be that of an image of another camera's size.

    It is where it equals that of the other camera, which has another size, or where the principal point lies outside of
    the own image, and inside of the other one.
    """
    cameras = facts.declared.cameras
    return tuple(
        IntrinsicsOfSize(name, other.width, other.height, 100 * (other.width / camera.width - 1))
        for name, camera in cameras.items()
        for other_name, other in cameras.items()
        if other_name != name
        and other.width != camera.width
        and (np.array_equal(camera.K, other.K) or not _centre_inside(camera, camera))
        and _centre_inside(camera, other)
        # Where both have one K, it is that of the image in the middle of which the principal point lies.
        and _from_middle(camera, camera) > _from_middle(camera, other)
    )


def resized_images(facts: Facts) -> tuple[IntrinsicsOfSize, ...]:
    """Return the cameras whose K may be that of an image that was resized, by where its principal point lies.

    A principal point lies about in the middle of its image: of an image of width w at (w - 1) / 2. Where it lies in the
    middle of another width and height, by about one ratio of both, K is that of this image. Its size is stated to the
    pixel by a principal point that was designed; by one that was calibrated it is the nearest common ratio.
    """
    faults = []
    for name, camera in facts.declared.cameras.items():
        # Width and height of the image in the middle of which the principal point lies.
        width, height = (2 * float(camera.K[i, 2]) + 1 for i in (0, 1))
        ratios = width / camera.width, height / camera.height
        if is_transposed(camera.K) or not np.isfinite(ratios).all() or min(ratios) < _FROM_MIDDLE:
            continue
        is_of_own_size = min(ratios) <= 1 + _FROM_MIDDLE and max(ratios) >= 1 - _FROM_MIDDLE
        if is_of_own_size or max(ratios) > _SHAPES * min(ratios):
            continue
        # Rows of K that were multiplied keep a principal point in the middle at this ratio of it.
        multiplied = [float(2 * camera.K[i, 2] / (size - 1)) for i, size in enumerate((camera.width, camera.height))]
        if abs(multiplied[0] - multiplied[1]) < _SAME * multiplied[0]:
            width, height = multiplied[0] * camera.width, multiplied[0] * camera.height
            faults.append(
                IntrinsicsOfSize(name, round(width), round(height), 100 * (multiplied[0] - 1), about_corner=False)
            )
            continue
        ratio = sqrt(ratios[0] * ratios[1])
        common = min(_RESIZINGS, key=lambda each: abs(log(ratio / each)))
        # Designed: (width - 1) / 2, or width / 2, which is half a pixel beside it.
        is_whole = abs(width - round(width)) < _SAME * width and abs(height - round(height)) < _SAME * height
        if not is_whole and abs(log(ratio / common)) < _FROM_MIDDLE:
            width, height = common * camera.width, common * camera.height
        faults.append(IntrinsicsOfSize(name, round(width), round(height), 100 * (width / camera.width - 1)))
    return tuple(faults)


def support_of_resizing(facts: Facts, name: str) -> float:
    """Return the support of a resized image: more where the principal point is outside of the image of the camera."""
    camera = facts.declared.cameras[name]
    row = "of_resized_image" if _centre_inside(camera, camera) else "of_another_size"
    return support(f"metadata.{row}")


def sizes_of_images(facts: Facts) -> tuple[IntrinsicsOfSize | IntrinsicsOfSizes, ...]:
    """Return the cameras whose K may be that of an image of another size: all that were resized, then each of them."""
    resized = resized_images(facts)
    together = (IntrinsicsOfSizes(resized),) if len(resized) > 1 else ()
    return (*together, *dict.fromkeys((*resized, *other_sizes(facts))))


def centres_from_middle(facts: Facts) -> tuple[PrincipalPointFromMiddle, ...]:
    """Return the cameras whose principal point may be counted from the middle of the image: it lies about at 0, 0."""
    largest_px = {
        name: signed_length((-(camera.width - 1) / 2, -(camera.height - 1) / 2))
        for name, camera in facts.declared.cameras.items()
        if not is_transposed(camera.K)
        and 2 * abs(camera.K[0, 2]) < _FROM_MIDDLE * camera.width
        and 2 * abs(camera.K[1, 2]) < _FROM_MIDDLE * camera.height
    }
    return (PrincipalPointFromMiddle(tuple(largest_px), min(largest_px.values())),) if largest_px else ()


def other_views(facts: Facts) -> tuple[FocalLength, ...]:
    """Return the focal lengths that may be made of an angle of view by a wrong formula.

    An angle of view gives f = (side / 2) / tan(view / 2). A camera whose view is that of another camera but for the
    ratio of two of its own sides has it from the wrong side: height, width or diagonal. Where its view is twice or half
    that of the other camera, the angle was not halved, or was halved twice; where the tangent is the reciprocal, f was
    multiplied by it. Of three cameras or more it is the one that has not the view of the others. Views whose tangents
    have the ratio two are left out: so are those of an image and of its half.
    """
    cameras = facts.declared.cameras
    # Tangent of half of the view along the columns.
    tangents = {
        name: camera.width / (2 * float(camera.K[0, 0])) for name, camera in cameras.items() if camera.K[0, 0] > 0
    }
    faults = []
    for name, tangent in tangents.items():
        others = [other for other_name, other in tangents.items() if other_name != name]
        if not others or any(abs(other / others[0] - 1) > _SAME_VIEW for other in others):
            continue
        width, height = cameras[name].width, cameras[name].height
        sides = (width, height, hypot(width, height))
        # f' = f side' / side, so that the tangent of the view is that of the others times side / side'.
        ratios = {side / other for side, other in permutations(sides, 2)} if width != height else set()
        ratios |= {tan(factor * atan(tangent)) / tangent for factor in (0.5, 2.0)} | {1 / tangent**2}
        if any(abs(others[0] / tangent / ratio - 1) < _SAME_VIEW for ratio in ratios):
            faults.append(FocalLength("metadata", 100 * (others[0] / tangent - 1), name))
    return tuple(faults)


def unequal_focal_lengths(facts: Facts) -> tuple[FocalLength, ...]:
    """Return the focal lengths of cameras whose pixels are not square, where those of all other cameras are.

    Pixels of sensors are square. One focal length, along rows or columns, is then that of an angle of view for another
    shape of image, or of an image that was stretched. First is the one along rows, which is computed from the other
    one more often, unless the other one leaves the view of the other cameras.
    """
    cameras = facts.declared.cameras
    ratios = {name: float(camera.K[1, 1] / camera.K[0, 0]) for name, camera in cameras.items()
              if min(camera.K[0, 0], camera.K[1, 1]) > 0 and not is_transposed(camera.K)}  # fmt: skip
    if len(ratios) < len(cameras):
        return ()
    odd = [name for name, ratio in ratios.items() if abs(ratio - 1) > _SAME]
    if len(odd) != 1 or len(cameras) <= len(odd):
        return ()
    name, ratio = odd[0], ratios[odd[0]]
    rows = FocalLength("metadata", 0.0, name, 100 * (ratio - 1))
    columns = FocalLength("metadata", 100 * (1 / ratio - 1), name, 0.0)
    others = [camera for other, camera in cameras.items() if other != name]

    def is_shared(focal_px: float) -> bool:
        """Whether a focal length gives the view of another camera."""
        return any(
            abs(focal_px / cameras[name].width * other.width / other.K[0, 0] - 1) < _SAME_VIEW for other in others
        )

    by_rows = is_shared(cameras[name].K[1, 1]) and not is_shared(cameras[name].K[0, 0])
    return (columns, rows) if by_rows else (rows, columns)


def film_focal_lengths(facts: Facts) -> tuple[FilmFocalLength, ...]:
    """Return the films of which focal lengths may be in millimetres; none where no camera's view is too wide.

    One maker declares all cameras, and a small image may have about as many pixels as a film has millimetres: all of
    them are first.
    """
    cameras = facts.declared.cameras
    longer_px = {name: max(camera.width, camera.height) for name, camera in cameras.items()}
    too_wide = tuple(
        name
        for name, camera in cameras.items()
        if (camera.lens is None or camera.lens.model == "radtan")
        and 0 < min(camera.K[0, 0], camera.K[1, 1]) < longer_px[name] / _WIDEST
    )
    if not too_wide:
        return ()
    return tuple(
        FilmFocalLength(film_mm, names, 100 * (film_mm / max(longer_px[name] for name in names) - 1))
        for names in dict.fromkeys((tuple(cameras), too_wide))
        for film_mm in _FILMS_MM
    )


def opposite_focal_lengths(facts: Facts) -> tuple[FocalLength, ...]:
    """Return the focal lengths that are negative, along columns or rows, as where image rows count upwards."""
    cameras = facts.declared.cameras
    signs = {name: (bool(camera.K[0, 0] < 0), bool(camera.K[1, 1] < 0)) for name, camera in cameras.items()}
    names: tuple[str | None, ...] = tuple(name for name, negative in signs.items() if any(negative))
    if names and len(set(signs.values())) == 1:
        names = (None,)
    faults = []
    for name in names:
        negative = signs[name if name is not None else next(iter(cameras))]
        percent, rows_percent = (_OPPOSITE_PERCENT if each else 0.0 for each in negative)
        faults.append(FocalLength("metadata", percent, name, rows_percent))
    return tuple(faults)


def _centre_inside(camera: Camera, image: Camera) -> bool:
    """Whether the principal point of a camera lies inside of the image of this or another one."""
    return bool(abs(camera.K[0, 2] - (image.width - 1) / 2) <= image.width / 2
                and abs(camera.K[1, 2] - (image.height - 1) / 2) <= image.height / 2)  # fmt: skip


def _from_middle(camera: Camera, image: Camera) -> float:
    """Return the distance of a camera's principal point from the middle of an image, in widths of it."""
    right_px, down_px = camera.K[0, 2] - (image.width - 1) / 2, camera.K[1, 2] - (image.height - 1) / 2
    return hypot(right_px, down_px) / image.width


def mounting_units(facts: Facts) -> tuple[MountingUnit, ...]:
    """Return the units in which positions of the cameras may be declared; none where they are near the body."""
    distances_m = (float(np.linalg.norm(camera.T_body_camera[:3, 3])) for camera in facts.declared.cameras.values())
    farthest_m = max(distances_m, default=0.0)
    if not _FARTHEST_M < farthest_m < np.inf:
        return ()
    return tuple(MountingUnit(unit, farthest_m * (1 - 1 / unit)) for unit in _UNITS if farthest_m / unit < _FARTHEST_M)


def odd_centres(facts: Facts) -> tuple[PrincipalPointShift, ...]:
    """Return the principal points that are probably declared wrongly, by how much they are too far right and down.

    They are those by another convention than the layout's, (W-1)/2, and the one that follows no convention where those
    of all other cameras do. A principal point that is declared wrongly follows a convention with probability 0, a
    correct one of a designed camera always does (Bayes, for any prior): that one is wrong sooner than an image is.
    """
    cameras = facts.declared.cameras
    offsets_px = {name: convention_offset_px(camera) for name, camera in cameras.items()}
    shifts = [PrincipalPointShift("metadata", px, px, name) for name, px in offsets_px.items() if px]
    if len(shifts) == len(cameras) > 1 and len(set(offsets_px.values())) == 1:
        # One writer declared all of them.
        shifts.insert(0, replace(shifts[0], camera=None))
    odd = [name for name, camera in cameras.items() if not is_chosen(camera, "intrinsics_centre")]
    if len(odd) == 1 and len(cameras) > 1:
        camera, common_px = cameras[odd[0]], {px for name, px in offsets_px.items() if name != odd[0]}
        by_px = common_px.pop() if len(common_px) == 1 else 0.0
        right_px, down_px = (float(camera.K[i, 2]) - (size - 1) / 2 - by_px
                             for i, size in enumerate((camera.width, camera.height)))  # fmt: skip
        if np.isfinite([right_px, down_px]).all() and not is_transposed(camera.K):
            shifts.append(PrincipalPointShift("metadata", right_px, down_px, odd[0]))
    return tuple(shifts)


def odd_intrinsics(facts: Facts) -> tuple[IntrinsicsOfAnotherImage, ...]:
    """Return the one camera whose view and principal point are not those of the others, with what makes them so.

    Cameras that were designed together have one view, and principal points by one convention. Of three or more, one
    that has neither, of numbers that nobody chose, has K of other images: those before they were rectified, or of
    another camera.
    """
    cameras = facts.declared.cameras
    for shift in odd_centres(facts):
        others = [camera for name, camera in cameras.items() if name != shift.camera]
        if (
            shift.camera is None
            or len(others) < _FEWEST_OTHERS
            or not all(is_chosen(camera, "intrinsics_centre") for camera in others)
        ):
            continue
        camera = cameras[shift.camera]
        ratios = [float(camera.K[0, 0] / other.K[0, 0] * other.width / camera.width) for other in others]
        is_one_view = all(abs(ratio / ratios[0] - 1) < _SAME_VIEW for ratio in ratios)
        if is_one_view and abs(ratios[0] - 1) > _SAME_VIEW and not is_chosen(camera, "intrinsics_focal"):
            return (IntrinsicsOfAnotherImage(shift.camera, 100 * (ratios[0] - 1), shift.columns_px, shift.rows_px),)
    return ()


def hypotheses_of_centres(facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the largest of these displacements as the cause of a shift; none where there is none."""
    shifts = odd_centres(facts)
    if not shifts:
        return ()
    size_px = max((shift.magnitude for shift in shifts), key=abs)
    return (Hypothesis("intrinsics_centre", "metadata", support("metadata.centre_apart"), size_px, "px"),)


def is_chosen(camera: Camera, cause: str) -> bool:
    """Whether the numbers of a camera that a cause would change are round, as those of a designed camera.

    A designed camera has a round field of view, its principal point in the middle, and an optical axis along an axis of
    the body or at a round angle to it. A declaration that is wrong by a random amount is round with probability 0, a
    correct one often is. So where a declaration is round, it is correct (Bayes, for any prior).

    Parameters
    ----------
    camera
        As declared.
    cause
        As in ``fedora_qa.causes``.

    Returns
    -------
    bool
        False for causes that change no number of a camera.
    """
    if cause == "intrinsics_focal":
        # Pixels are square, and the field of view, or the focal length itself, is round.
        fx, fy = camera.K[0, 0], camera.K[1, 1]
        # Pinhole camera: tan(view / 2) = (width / 2) / fx.
        view_deg = np.degrees(2 * np.arctan(camera.width / (2 * fx)))
        return bool(abs(fx - fy) < _SAME * fx and (_round(view_deg, _ROUND_DEG) or _round(fx, _ROUND_DEG)))
    if cause == "intrinsics_centre":
        return all(
            # Px. Centres at 0, 1, ...: (size - 1) / 2; corners there: size / 2; centres at 1, 2, ...: (size + 1) / 2.
            any(abs(centre - (size + by) / 2) < _SAME * size for by in (-1, 0, 1))
            for centre, size in ((camera.K[0, 2], camera.width), (camera.K[1, 2], camera.height))
        )
    if cause == "extrinsic_rotation":
        R_body_camera = camera.T_body_camera[:3, :3]
        # Entries 0 and +-1 only: the camera is mounted at right angles to the axes of the body.
        straight = bool(np.all(np.abs(R_body_camera - np.rint(R_body_camera)) < _SAME))
        # Rotation vector from a camera with its optical axis along X forward of the body.
        angles_deg = Rotation.from_matrix(R_body_camera @ np.array(R_BODY_OPTICAL).T).as_rotvec(degrees=True)
        # Rotation about one axis by a round angle.
        about_single_axis = np.count_nonzero(np.abs(angles_deg) > _SAME) == 1
        return straight or (about_single_axis and _round(np.abs(angles_deg).max(), _ROUND_DEG))
    return False


def _round(value: float, to: float) -> bool:
    # Relative to the value, but to one step at least: near 0 a relative tolerance would refuse rounding errors.
    return bool(abs(value / to - np.rint(value / to)) * to < _SAME * max(abs(value), to))


def inverted_mountings(facts: Facts) -> tuple[InvertedMounting, ...]:
    """Return the cameras that have the axes of all others once their mounting is inverted, and have not as declared.

    Of two cameras either may be the inverse of the other: the one that looks farther from straight ahead is first.
    """
    cameras = {name: camera for name, camera in facts.declared.cameras.items() if _is_rotated(camera)}
    inverted = [
        name
        for name, camera in cameras.items()
        if (others := [other for other_name, other in cameras.items() if other_name != name])
        and not any(_has_axes_of(camera, other) for other in others)
        and all(_has_axes_of(_inverse(camera), other) for other in others)
    ]
    return tuple(InvertedMounting(name) for name in sorted(inverted, key=lambda name: -_from_straight(cameras[name])))


def brings_centres_together(facts: Facts) -> bool:
    """Whether the centres of depth and events are one point once an inverted mounting is inverted back."""
    cameras = facts.declared.cameras
    if not {"depth", "events"} <= cameras.keys():
        return False
    for fault in inverted_mountings(facts):
        depth_m, events_m = (
            (_inverse(cameras[name]) if name == fault.camera else cameras[name]).T_body_camera[:3, 3]
            for name in ("depth", "events")
        )
        if np.abs(depth_m - events_m).max() <= CENTRES_AGREE_M:
            return True
    return False


def mountings_of_other_bodies(facts: Facts) -> tuple[CameraAxes | InvertedMounting, ...]:
    """Return the conventions by which all cameras may be declared; none where one looks about straight ahead, upright.

    A body with Y to the right and Z down is the commonest other one. Another one is that of the exchanged and negated
    axes in which a camera comes nearest to straight ahead. Inverted, mountings may come nearer, too. Cameras may look
    down, so that none of these is likely before a trial.
    """
    cameras = [camera for camera in facts.declared.cameras.values() if _is_rotated(camera)]
    nearest = [_nearest_axes(camera.T_body_camera[:3, :3] @ np.array(R_BODY_OPTICAL).T) for camera in cameras]
    if not cameras or any(np.array_equal(axes, np.eye(3)) for axes in nearest):
        return ()
    bodies = dict.fromkeys((FRD_FROM_FLU, *(_matrix(axes) for axes in nearest)))
    inverses = (InvertedMounting(),) if all(_from_straight(_inverse(c)) < _from_straight(c) for c in cameras) else ()
    # Cameras that are not rotated have the optical axes of no camera: those of the body were taken for them.
    is_bare = all(np.allclose(camera.T_body_camera[:3, :3], np.eye(3), atol=AXES_AGREE) for camera in cameras)
    bare = (CameraAxes(),) if is_bare else ()
    return (*bare, *inverses, *(CameraAxes(SAME_AXES, body_axes) for body_axes in bodies))


def _inverse(camera: Camera) -> Camera:
    return replace(camera, T_body_camera=np.linalg.inv(camera.T_body_camera).astype(np.float64))


def _from_straight(camera: Camera) -> float:
    """Return the angle of a camera from one that looks straight ahead, rad."""
    R = np.array(R_BODY_OPTICAL).T @ camera.T_body_camera[:3, :3]
    return float(Rotation.from_matrix(R).magnitude())


def _nearest_axes(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation that only exchanges and negates axes and is nearest to another rotation."""
    # The 24 rotations of a cube.
    axes = Rotation.create_group("O").as_matrix()
    return np.asarray(np.rint(axes[np.argmax(np.einsum("nij,ij->n", axes, R))]), dtype=np.float64)


def _matrix(rows: NDArray[np.float64]) -> Matrix3:
    first, second, third = ((float(x), float(y), float(z)) for x, y, z in rows + 0.0)
    return first, second, third


def odd_mounting(facts: Facts) -> MountingRotation | None:
    """Return the rotation of the one camera whose axes differ from the common axes of all others.

    Cameras of one rig look in one direction. A camera that does not, by an angle that nobody chose (``is_chosen``), is
    declared wrongly, or was bent; except for a camera with a lens beside its rectified views. One that looks far away,
    by whatever angle, shows nothing of what the others show.

    Parameters
    ----------
    facts
        With the declared cameras.

    Returns
    -------
    MountingRotation | None
        Of that camera against the others; None without other cameras, or where several differ.
    """
    cameras = {name: camera for name, camera in facts.declared.cameras.items() if _is_rotated(camera)}
    odd = [
        (name, others[0])
        for name, camera in cameras.items()
        if (others := [other for other_name, other in cameras.items() if other_name != name])
        and all(_has_axes_of(others[0], other) for other in others)
        and not _has_axes_of(others[0], camera)
        and not (
            is_about_parallel(others[0], camera)
            and (is_chosen(camera, "extrinsic_rotation") or _is_rectified_to(others[0], camera))
        )
    ]
    # Of two cameras that differ, neither is odd unless the numbers of the other were chosen.
    if len(odd) != 1:
        return None
    ((name, other),) = odd
    # R_odd = R_others Exp(rotation).
    R = other.T_body_camera[:3, :3].T @ cameras[name].T_body_camera[:3, :3]
    x_deg, y_deg, z_deg = (float(angle) for angle in Rotation.from_matrix(R).as_rotvec(degrees=True))
    return MountingRotation("metadata", (x_deg, y_deg, z_deg), name)


def _is_rectified_to(view: Camera, camera: Camera) -> bool:
    """Whether a camera has a lens and the view has none: the axes of rectified views follow from both of their cameras.

    They are at an angle to each of them, which nobody chose either.
    """
    return camera.lens is not None and view.lens is None


def _is_rotated(camera: Camera) -> bool:
    """Whether the declared mounting has a rotation, not a mirroring or another matrix."""
    R = camera.T_body_camera[:3, :3]
    return bool(np.isfinite(R).all() and np.abs(R.T @ R - np.eye(3)).max() <= AXES_AGREE and np.linalg.det(R) > 0)


def _has_axes_of(camera1: Camera, camera2: Camera) -> bool:
    return bool(np.abs(camera1.T_body_camera[:3, :3] - camera2.T_body_camera[:3, :3]).max() <= AXES_AGREE)
