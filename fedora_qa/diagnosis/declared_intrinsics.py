"""Improbable intrinsics of the declared cameras, each with what corrects it.

K may be transposed, or of an image of another size, have focal lengths in millimetres or of the opposite sign, or have
a principal point apart from the others.
"""

from dataclasses import replace
from itertools import permutations
from math import atan, hypot, log, sqrt, tan
from typing import Final

import numpy as np

from fedora_qa.checks.metadata.cameras import convention_offset_px
from fedora_qa.diagnosis.designed_cameras import SAME, is_chosen
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.faults.fault import signed_length
from fedora_qa.faults.intrinsic_units import FilmFocalLength, NormalisedIntrinsics, NormalisedUnit
from fedora_qa.faults.intrinsics import (
    FocalLength,
    IntrinsicsOfAnotherImage,
    IntrinsicsOfSize,
    IntrinsicsOfSizes,
    PrincipalPointFromMiddle,
    PrincipalPointShift,
    TransposedIntrinsics,
    is_transposed,
)
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts

_WIDEST: Final = 4.0
"""Largest ratio of the longer side of an image to the focal length: the shortest focal length of a lens that images
straight lines as such is 9 mm, for film of 36 mm, which is a view of 127 degrees."""

_FILMS_MM: Final = (36.0, 20.955, 23.76)
"""Longer sides of films for which focal lengths are given in mm: of 35 mm photography and Blender; of USD and Isaac
Sim; of Unreal."""

_LONGEST: Final = 10.0
"""Largest focal length in units of the image: a view of 6 degrees. Those in millimetres of a film are longer than 5."""

_SAME_VIEW: Final = 1e-3
"""Largest relative difference of the tangents of two views that are equal: focal lengths are stored with four digits at
least."""

_OPPOSITE_PERCENT: Final = -200.0
"""Excess of a focal length that has the opposite sign."""

_FEWEST_OTHERS: Final = 2
"""Cameras that must be alike for another one to be odd: of two that differ either may be."""

_FROM_MIDDLE: Final = 0.2
"""Largest distance of a principal point from the middle of its image, in halves of the image. The value is not derived:
lenses are centred to a tenth of the width, and a trial decides."""

_SHAPES: Final = 16 / 9 / (5 / 4)
"""Largest ratio of two shapes of images: the widest and the narrowest that are common."""

_RESIZINGS: Final = tuple(factor * 2.0**power for power in range(-2, 6) for factor in (1.0, 1.5))
"""Ratios by which images are commonly resized: halves, and halves of three."""


def transposed_hypothesis(facts: Facts) -> Hypothesis:
    """Return the principal points at 0, 0 of cameras with a transposed K as a cause."""
    size_px = transposed(facts).magnitude
    return Hypothesis("intrinsics_centre", "metadata", support("metadata.transposed_K"), size_px, "px")


def hypothesis_of_unit(fault: NormalisedIntrinsics | FilmFocalLength) -> Hypothesis:
    """Return the unit of a focal length as the cause of a view that no lens has."""
    return Hypothesis("intrinsics_focal", fault.stream, support("metadata.view_too_wide"), fault.magnitude, "percent")


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
        if abs(multiplied[0] - multiplied[1]) < SAME * multiplied[0]:
            width, height = multiplied[0] * camera.width, multiplied[0] * camera.height
            faults.append(
                IntrinsicsOfSize(name, round(width), round(height), 100 * (multiplied[0] - 1), about_corner=False)
            )
            continue
        ratio = sqrt(ratios[0] * ratios[1])
        common = min(_RESIZINGS, key=lambda each: abs(log(ratio / each)))
        # Designed: (width - 1) / 2, or width / 2, which is half a pixel beside it.
        is_whole = abs(width - round(width)) < SAME * width and abs(height - round(height)) < SAME * height
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
        and not _units_of_image(camera)
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
    ratios = {
        name: float(camera.K[1, 1] / camera.K[0, 0])
        for name, camera in cameras.items()
        if min(camera.K[0, 0], camera.K[1, 1]) > 0 and not is_transposed(camera.K) and not _units_of_image(camera)
    }
    if len(ratios) < len(cameras):
        return ()
    odd = [name for name, ratio in ratios.items() if abs(ratio - 1) > SAME]
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
    too_wide = tuple(name for name, camera in cameras.items() if _is_too_wide(camera) and not _units_of_image(camera))
    if not too_wide:
        return ()
    return tuple(
        FilmFocalLength(film_mm, names, 100 * (film_mm / max(longer_px[name] for name in names) - 1))
        for names in dict.fromkeys((tuple(cameras), too_wide))
        for film_mm in _FILMS_MM
    )


def normalised_intrinsics(facts: Facts) -> tuple[NormalisedIntrinsics, ...]:
    """Return the units of the image in which K of cameras may be: no view is as wide, and the centre is within a pixel.

    A principal point in the middle is at 1/2, 1/2 in sides from the corner, and at 0, 0 in units from the middle.
    Pixels are square: where focal lengths along both axes differ as the sides do, they are in halves of these, and
    where they are equal in longer sides.
    """
    units = {name: _units_of_image(camera) for name, camera in facts.declared.cameras.items()}
    faults = []
    for unit in dict.fromkeys(unit for of_camera in units.values() for unit in of_camera):
        names = tuple(name for name, of_camera in units.items() if unit in of_camera)
        longest_px = max(facts.declared.cameras[name].width for name in names)
        pixels = longest_px / 2 if unit == "halves" else longest_px
        faults.append(NormalisedIntrinsics(unit, names, 100 * (1 / pixels - 1)))
    return tuple(faults)


def _units_of_image(camera: Camera) -> tuple[NormalisedUnit, ...]:
    """Return the units of the image in which K of a camera may be, likeliest first; none where it is in pixels."""
    fx, fy = float(camera.K[0, 0]), float(camera.K[1, 1])
    if not _is_too_wide(camera) or max(fx, fy) > _LONGEST or np.any(camera.K[[0, 1, 1, 2, 2], [1, 0, 0, 0, 1]]):
        return ()
    from_middle = float(np.max(np.abs(camera.K[:2, 2])))
    from_half = float(np.max(np.abs(camera.K[:2, 2] - 0.5)))
    if from_half < _FROM_MIDDLE:
        return ("sides",)
    if from_middle >= _FROM_MIDDLE:
        return ()
    # f_px = fx W / 2 = fy H / 2 in halves, and fx = fy in longer sides.
    of_halves, of_longer = (abs(log(fx / fy * ratio)) for ratio in (camera.width / camera.height, 1.0))
    return ("halves", "longer_side") if of_halves <= of_longer else ("longer_side", "halves")


def _is_too_wide(camera: Camera) -> bool:
    """Whether no lens that images straight lines as such has a view as wide."""
    shorter = min(camera.K[0, 0], camera.K[1, 1])
    is_straight = camera.lens is None or camera.lens.model == "radtan"
    return bool(is_straight and 0 < shorter < max(camera.width, camera.height) / _WIDEST)


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
