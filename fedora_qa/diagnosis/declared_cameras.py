"""Hypotheses for declared cameras whose numbers are improbable, as causes of whatever depends on these cameras.

K may be transposed, or of an image of another size, have focal lengths in millimetres or of the opposite sign, or have
a principal point apart from the others; positions may be in another unit, and one camera of a rig may look elsewhere
than the others. Each such declaration states its own correction, which a trial tests.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fedora_qa.diagnosis.declared_intrinsics import (
    centres_from_middle,
    film_focal_lengths,
    hypothesis_of_unit,
    normalised_intrinsics,
    opposite_focal_lengths,
    other_sizes,
    other_views,
    resized_images,
    support_of_resizing,
    transposed_hypothesis,
    unequal_focal_lengths,
)
from fedora_qa.diagnosis.declared_mountings import (
    inverted_mountings,
    mounting_units,
    mountings_of_other_bodies,
    odd_mounting,
)
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.faults.intrinsics import (
    is_transposed,
)
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

_CAMERAS_OF_SUBJECT: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {
        "flow_geometry": frozenset({"depth"}),
        "depth": frozenset({"depth"}),
        "alignment": frozenset({"rgb", "depth", "events"}),
        "event_response": frozenset({"rgb", "events"}),
        "flow_photometric": frozenset({"rgb", "depth"}),
        "images": frozenset({"rgb", "depth"}),
    }
)
"""Cameras by which the checks of a subject compare streams."""

_WITH_PARALLAX: Final = frozenset({"flow_geometry", "depth"})
"""Subjects in which the position of a camera on the body takes part."""


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
    for too_wide in (normalised_intrinsics(facts), film_focal_lengths(facts)):
        # The first unit is the likeliest.
        hypotheses += [hypothesis_of_unit(each) for each in too_wide if names & set(each.names)][:1]
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
