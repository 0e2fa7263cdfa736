"""Rules about each sequence by itself: its name, its streams, its cameras."""

import re
from collections.abc import Iterable, Mapping

import numpy as np

from fedora_qa.gate.contents import Contents
from fedora_qa.gate.release_result import ReleaseResult, Violation
from fedora_qa.sequence.declared import Camera

ContentsByName = Mapping[str, Contents]
"""The contents of each sequence that can be opened, by its name, in order."""


def rule_on_names(names: Iterable[str], pattern: str) -> ReleaseResult:
    """Every name matches the pattern as a whole."""
    violations = [
        Violation(name, "pattern", f"Expected a name that matches {pattern}, got {name}")
        for name in names
        if not re.fullmatch(pattern, name)
    ]
    return ReleaseResult("release.naming", "Is the sequence named as the policy asks?", "each", tuple(violations))


def rule_on_streams(contents_by_name: ContentsByName, required: Iterable[str]) -> ReleaseResult:
    """Every sequence holds the required streams."""
    violations = [
        Violation(name, "missing", f"Expected the stream {stream}, got none: {_why(contents, stream)}", stream)
        for name, contents in contents_by_name.items()
        for stream in required
        if stream not in contents.streams
    ]
    return ReleaseResult("release.streams", "Are all required streams there?", "each", tuple(violations))


def rule_on_intrinsics(contents_by_name: ContentsByName, cameras: Iterable[str]) -> ReleaseResult:
    """Every sequence declares the intrinsics of the first that declares any."""
    violations = [violation for camera in cameras for violation in _other_intrinsics(contents_by_name, camera)]
    question = "Are the intrinsics those of the other sequences?"
    return ReleaseResult("release.intrinsics", question, "each", tuple(violations))


def _other_intrinsics(contents_by_name: ContentsByName, name: str) -> Iterable[Violation]:
    declared = {sequence: contents.cameras.get(name) for sequence, contents in contents_by_name.items()}
    first = next((pair for pair in declared.items() if pair[1]), None)
    for sequence, camera in declared.items():
        if camera is None:
            yield Violation(sequence, "undeclared", f"Expected the camera {name} to be declared, got none", name)
        elif first and first[1] and not _same(camera, first[1]):
            message = (
                f"Expected the intrinsics of the camera {name} in {first[0]} ({_words(first[1])}), got {_words(camera)}"
            )
            yield Violation(sequence, "differ", message, name)


def _same(first: Camera, other: Camera) -> bool:
    """Whether two cameras project alike, to nine digits: what is declared may have passed through text."""
    sizes = (first.width, first.height, first.model) == (other.width, other.height, other.model)
    return sizes and np.allclose(first.K, other.K, rtol=1e-9, atol=0.0)


def _words(camera: Camera) -> str:
    focal, centre = np.diag(camera.K)[:2], camera.K[:2, 2]
    return (
        f"{camera.model} {camera.width}x{camera.height}, f {focal[0]:.9g}, {focal[1]:.9g}, "
        f"c {centre[0]:.9g}, {centre[1]:.9g} px"
    )


def _why(contents: Contents, stream: str) -> str:
    return contents.absent.get(stream, "the file has no such rate")
