"""Is every dataset at its place in the layout, in the declared type and shape?"""

from dataclasses import dataclass

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.flow_rate_deviations import with_flow_rate_deviations
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import is_flow_stream
from fedora_qa.layout.dataset_binder import LayoutProblem
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts


@dataclass(frozen=True, slots=True)
class LayoutDefect(Feature):
    """A problem that was found when the file was opened.

    Attributes
    ----------
    problem
        The problem.
    """

    problem: LayoutProblem


class IntegrityLayout(FactsCheck):
    """Is everything that the file promises there, in the right shape and type?

    The problems that opening the file met, one finding each.

    Why it matters
    --------------
    Loaders index what they expect. A stream that is missing, transposed or one row short is a crash on another
    machine at best, and a silent misalignment of rows at worst.

    How
    ---
    Every dataset of the layout is looked for where the file's dialect puts it. Counted as broken: a stream that the
    metadata declare and that is absent or only partly there, shapes that contradict the layout or each other, types
    that lose what it holds, links that leave the file or dangle, chunks that were never written. A stream is declared
    by its metadata, by its group, and by an index map. Flow is looked for at every rate that a name in its
    group states; a name that states no rate, and a second name of one rate, are counted as broken. Other types that
    hold the same values (depth in float64, IMU in float32, polarity as bool or as -1 and 1, columns in uint32) are
    read, and noted. So is a name that is nearly that of an absent stream, and that the layout lacks.

    Noise model
    -----------
    None: a dataset is as promised or not. Nothing is sampled.

    Cannot see
    ----------
    Values: they are not looked at. A stream that the file neither holds nor declares is absent and no fault, unless a
    profile or a policy promises it. Layouts that no dialect describes: see ``fedora-qa layout``.

    Sources
    -------
    The canonical layout, version 1.0; for files of other makers the dialect that was recognised.
    """

    name = "integrity.layout"

    def examine(self, facts: Facts) -> Observation:
        """State one finding a problem."""
        problems = facts.layout.problems
        # Datasets that a problem keeps out of the layout: not covered.
        broken = {problem.key for problem in problems if problem.key} - set(facts.layout.bindings)
        coverage = Coverage(len(facts.layout.bindings), len(facts.layout.bindings) + len(broken), "datasets")
        notices = tuple(
            Notice(problem.code, problem.message, Where(stream=problem.stream))
            for problem in problems
            if problem.is_lossless
        )
        problems = tuple(problem for problem in problems if not problem.is_lossless)
        if not problems:
            return Observation(coverage, (no_faults("layout_problems", "problems", self.name),), notices)
        defects = [
            count_of_faults(
                name=f"{problem.key or problem.stream}.{problem.code.rsplit('.', 1)[1]}",
                value=1,
                unit="problems",
                statement=problem.message,
                code=problem.code,
                where=Where(stream=problem.stream),
                severity="critical",
                features=(LayoutDefect(problem),),
            )
            for problem in problems
        ]
        # Absent rates count as well: a fault of all rates is one fault of the flow.
        rates = {problem.stream for problem in problems if is_flow_stream(problem.stream)} | set(facts.flow_streams)
        return Observation(coverage, with_flow_rate_deviations(defects, rates), notices)
