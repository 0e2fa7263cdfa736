"""Are the declarations complete and plausible?"""

from collections.abc import Mapping
from dataclasses import dataclass
from re import findall
from typing import Final

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import FORMAT_NAME
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import ATTRIBUTES, PINHOLE, PROMISED_BY, UNCALIBRATED
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import DeclarationProblem
from fedora_qa.sequence.facts import Facts

_STREAMS_OF_OWNER: Final[dict[str, tuple[str, ...]]] = {
    **{owner: (stream,) for stream, owner in PROMISED_BY.items()},
    "metadata/cameras/events": ("events",),
}
"""The streams that an object of the metadata describes. ``metadata/flow`` describes every rate of the file."""

_MOTION: Final = frozenset({"imu", "pose"})
"""Streams that can be read without any declaration: an imported file that holds these alone declares nothing."""

_LIGHTS: Final = {"day": {"day", "daylight"}, "night": {"night", "ngt"}}
"""Words of names by the light that they state; ``ngt`` is that of the paper."""

_PLACES: Final = {"park": {"park", "baylands"}, "racetrack": {"racetrack", "speedway"}}
"""Words of names by the place that they state: the paper's two, and the kinds of place that they are."""


@dataclass(frozen=True, slots=True)
class DeclarationDefect(Feature):
    """A problem that was found when the metadata were read.

    Attributes
    ----------
    problem
        The problem.
    """

    problem: DeclarationProblem


class MetadataComplete(FactsCheck):
    """Does the file declare everything that the format requires?

    The declarations that are missing or malformed, one finding each.

    Why it matters
    --------------
    A quantity that a file does not declare cannot be checked, and the data cannot be used without it: flow needs
    intrinsics, events need a threshold, and poses need their noise.

    How
    ---
    Every attribute of the layout is read. A required attribute of a stream that exists is a finding if it is missing or
    malformed. Any impossible number is a finding as well: one below zero, NaN, or a range that ends before it begins.
    An optional attribute that is malformed, or a whole group that is absent, is only noted: the checks that need it are
    weaker, or cannot run. Also noted are forms whose meaning is clear, such as a width as a float or a name in upper
    case. So are a light (day or night) that contradicts the name of the sequence or of its world, names of which one
    states the day and the other the night, and names of which one states a park (or Baylands) and the other a
    racetrack. A file of the canonical layout without any metadata gives one finding, not thirty.

    Noise model
    -----------
    None: an attribute exists with its type, or does not.

    Cannot detect
    -------------
    Whether a declaration is true: the checks that measure the declared quantity test that. Brightness does not
    distinguish day from night, because exposure compensates for the light. Names are free, so that no other words of
    the name of a sequence contradict its world. Attributes that the layout does not have, such as a duration or a
    number of events, are not read. Declarations of streams that the file does not hold are not required.

    Sources
    -------
    The canonical layout, version 1.0.
    """

    name = "metadata.complete"

    def examine(self, facts: Facts) -> Observation:
        """Separate problems of required declarations from those of optional ones."""
        count = len(ATTRIBUTES)
        # A file of the canonical layout that holds none of the objects that carry metadata.
        absent = {problem.owner for problem in facts.declared.problems if not problem.name}
        owners = {owner for owner, _ in ATTRIBUTES if owner.startswith("metadata/")}
        if facts.layout.dialect_name == FORMAT_NAME and owners <= absent and not facts.streams <= _MOTION:
            missing = count_of_faults(
                name="metadata.missing",
                value=1,
                unit="declarations",
                statement="a file of the canonical layout has a group /metadata; this file has none of it, so that "
                "no stream can be compared with a declaration",
                code="metadata.complete.missing",
                where=Where(stream="metadata"),
            )
            return Observation(Coverage(0, count, "declarations"), (missing,))
        # An absent stream needs no declaration.
        described = _STREAMS_OF_OWNER | {"metadata/flow": facts.flow_streams}
        problems = [
            problem
            for problem in facts.declared.problems
            if problem.name or problem.owner not in described or facts.streams.intersection(described[problem.owner])
        ]
        statistics: list[Statistic] = []
        notices: list[Notice] = []
        for problem in problems:
            place = f"/{problem.owner}" if problem.owner else "the file"
            text = f"{place} {problem.name}: {problem.message}" if problem.name else problem.message
            code = f"metadata.complete.{'missing' if problem.cause == 'missing_stream' else 'malformed'}"
            spec = ATTRIBUTES.get((problem.owner, problem.name))
            required = spec is not None and spec.required and not problem.usable
            # Another optional attribute that cannot be used only weakens the checks that need it.
            if required or problem.impossible:
                statistics.append(
                    count_of_faults(
                        name=f"{problem.owner}@{problem.name}",
                        value=1,
                        unit="declarations",
                        statement=text,
                        code=code,
                        where=Where(stream="metadata"),
                        features=(DeclarationDefect(problem),),
                    )
                )
            else:
                notices.append(Notice(code, text))
        declared = facts.declared
        for name, camera in declared.cameras.items():
            if camera.model not in (PINHOLE, UNCALIBRATED):
                message = (
                    f"/metadata/cameras/{name} camera_model: Expected {PINHOLE!r}, got {camera.model!r}: no check "
                    "compares what this camera images with other streams"
                )
                notices.append(Notice("metadata.complete.camera_model", message, Where(stream="metadata")))
        # A name is no declaration: "day 3" may count days.
        names = (
            (f"the sequence is named {declared.sequence!r}", declared.sequence),
            (f"the world is named {declared.world!r}", declared.world),
        )
        light = (f"the declared illumination is {declared.illumination!r}", declared.illumination)
        for stating, spellings in (((light, *names), _LIGHTS), (names, _PLACES)):
            stated = [(text, word) for text, name in stating if (word := _stated(name, spellings))]
            for text, word in stated[1:]:
                if word != stated[0][1]:
                    message = f"{text}, and {stated[0][0]}"
                    notices.append(Notice("metadata.complete.contradiction", message, Where(stream="metadata")))
        if not statistics:
            statistics.append(no_faults("declaration_problems", "declarations", self.name))
        return Observation(Coverage(count, count, "declarations"), tuple(statistics), tuple(notices))


def _stated(name: str, spellings: Mapping[str, set[str]]) -> str:
    """Return what a name states by a word of its own, such as ``day`` or ``park``; empty for nothing, or for two."""
    words = set(findall("[a-z]+", name.lower()))
    stated = [meaning for meaning, of_meaning in spellings.items() if words & of_meaning]
    return stated[0] if len(stated) == 1 else ""
