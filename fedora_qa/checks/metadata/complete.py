"""Are the declarations complete and plausible?"""

from dataclasses import dataclass
from typing import Final

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import FORMAT_NAME
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import ATTRIBUTES, FLOW_STREAMS, PROMISED_BY
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import DeclarationProblem
from fedora_qa.sequence.facts import Facts

_STREAMS_OF_OWNER: Final[dict[str, tuple[str, ...]]] = {
    **{owner: (stream,) for stream, owner in PROMISED_BY.items()},
    "metadata/cameras/events": ("events",),
    "metadata/flow": FLOW_STREAMS,
}
"""The streams that an object of the metadata describes."""


@dataclass(frozen=True, slots=True)
class DeclarationDefect(Feature):
    """A problem that reading the metadata met."""

    problem: DeclarationProblem


class MetadataComplete(FactsCheck):
    """Does the file declare all that the format requires?

    The declarations that are missing or malformed, one finding each.

    Why it matters
    --------------
    What a file does not say about itself cannot be checked, and cannot be used: flow without intrinsics, events
    without a threshold, poses without their noise are numbers without a meaning.

    How
    ---
    Every attribute of the layout is read. A required one that is missing or malformed, of a stream that is there, is
    broken; an optional one that is malformed, or a whole group that is absent, is only noted: what needs it can be
    tested weakly or not at all. A file of the canonical layout without any metadata is one finding, not thirty.

    Noise model
    -----------
    None: an attribute is there and of its type, or not.

    Cannot see
    ----------
    Whether a declaration is true; that is for the checks that measure what it is about. Declarations of streams that
    the file does not hold are not asked for.

    Sources
    -------
    The canonical layout, version 1.0.
    """

    name = "metadata.complete"

    def examine(self, facts: Facts) -> Observation:
        """Sort the problems by what the format asks for."""
        count = len(ATTRIBUTES)
        if _is_bare(facts):
            return Observation(Coverage(0, count, "declarations"), (self._bare(),))
        problems = [problem for problem in facts.declared.problems if _concerns(problem, facts)]
        broken = [problem for problem in problems if _is_required(problem)]
        noted = [problem for problem in problems if not _is_required(problem)]
        statistics = tuple(map(self._defect, broken)) or (no_faults("declaration_problems", "declarations", self.name),)
        notices = tuple(Notice(f"metadata.complete.{_rule(problem)}", _text(problem)) for problem in noted)
        return Observation(Coverage(count, count, "declarations"), statistics, notices)

    def _bare(self) -> Statistic:
        return count_of_faults(
            name="metadata.missing",
            value=1,
            unit="declarations",
            statement="a file of the canonical layout has a group /metadata; nothing of it is there, so that nothing "
            "that the file holds can be held to a declaration",
            code="metadata.complete.missing",
            where=Where(stream="metadata"),
        )

    def _defect(self, problem: DeclarationProblem) -> Statistic:
        return count_of_faults(
            name=f"{problem.owner}@{problem.name}",
            value=1,
            unit="declarations",
            statement=_text(problem),
            code=f"metadata.complete.{_rule(problem)}",
            where=Where(stream="metadata"),
            features=(DeclarationDefect(problem),),
        )


def _is_bare(facts: Facts) -> bool:
    """Whether a file of the canonical layout holds none of the objects that carry metadata."""
    absent = {problem.owner for problem in facts.declared.problems if not problem.name}
    owners = {owner for owner, _ in ATTRIBUTES if owner.startswith("metadata/")}
    return facts.layout.dialect_name == FORMAT_NAME and owners <= absent


def _concerns(problem: DeclarationProblem, facts: Facts) -> bool:
    """Whether the problem is about something that this file holds: an absent stream needs no declaration."""
    described = _STREAMS_OF_OWNER.get(problem.owner, ())
    return bool(problem.name) or not described or bool(facts.streams.intersection(described))


def _is_required(problem: DeclarationProblem) -> bool:
    spec = ATTRIBUTES.get((problem.owner, problem.name))
    return spec is not None and spec.required


def _rule(problem: DeclarationProblem) -> str:
    return "missing" if problem.cause == "missing_stream" else "malformed"


def _text(problem: DeclarationProblem) -> str:
    place = f"/{problem.owner}" if problem.owner else "the file"
    return f"{place} {problem.name}: {problem.message}" if problem.name else problem.message
