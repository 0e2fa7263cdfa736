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
    """Does every stream that the file declares exist, with the right shape and type?

    The problems that occurred when the file was opened, one finding each.

    Why it matters
    --------------
    Loaders rely on names, shapes and types. A stream that is missing, transposed or one row short causes an error on
    another machine at best, and a silent misalignment of rows at worst.

    How
    ---
    Every dataset of the layout is looked up at the path that the file's dialect states. A finding is: a stream that is
    declared, and absent or incomplete; shapes that contradict the layout or each other; types that cannot represent the
    values; links that leave the file or have no target; chunks that were never written. A stream is declared by its
    metadata, by its group, or by an index map. Flow is looked up at every rate that a name in its group states. A name
    that states no rate, and a second name for one rate, are findings. Other types that represent the same values (depth
    in float64, IMU in float32, polarity as bool or as -1 and 1, columns in uint32) are read and noted. An extra name
    that is nearly that of an absent stream is noted as well.

    Noise model
    -----------
    None: a dataset conforms or does not. Nothing is sampled.

    Cannot detect
    -------------
    Values: they are not read. A stream that the file neither holds nor declares is absent, and is a finding only if a
    profile or a policy requires it. Layouts that no dialect describes: see ``fedora-qa layout``.

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
