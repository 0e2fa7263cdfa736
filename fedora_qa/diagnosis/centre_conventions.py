"""Principal points by another convention than (W-1)/2: images then lie half a pixel off, or a whole one."""

from math import hypot

from fedora_qa.checks.metadata.cameras import convention_offset_px
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.sequence.facts import Facts


def convention_offsets_px(facts: Facts) -> dict[str, float]:
    """Return by how much the principal point of a camera is too far right and down, by camera that deviates."""
    offsets_px = {name: convention_offset_px(camera) for name, camera in facts.declared.cameras.items()}
    return {name: offset_px for name, offset_px in offsets_px.items() if offset_px}


def hypotheses_of_conventions(facts: Facts) -> tuple[Hypothesis, ...]:
    """Return principal points by another convention as the cause of a shift; none where all follow the layout's."""
    offset_px = max(convention_offsets_px(facts).values(), default=0.0)
    of_convention = support("metadata.centre_by_other_convention")
    size_px = hypot(offset_px, offset_px)
    return (Hypothesis("intrinsics_centre", "metadata", of_convention, size_px, "px"),) if offset_px else ()
