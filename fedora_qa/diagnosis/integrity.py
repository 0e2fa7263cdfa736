"""Hypotheses for values that are not finite, for defects of the layout, and for chunks that do not decode."""

from typing import Final

from fedora_qa.checks.integrity.finite import OutOfRange
from fedora_qa.checks.integrity.layout import LayoutDefect
from fedora_qa.checks.integrity.readable import RowsOfOtherForm
from fedora_qa.checks.protocol import Statistic
from fedora_qa.conventions import MM_PER_M
from fedora_qa.diagnosis.hypothesis import Hypothesis, over_all_rates, support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

_MOST: Final = 0.9
"""Least ratio of the values that a wrong unit must explain: it affects all values but a few at the ends of the
range."""


def propose_finite(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of values in a stream that are not finite, or out of range: first a type that lost them."""
    stream = alarm.finding.where.stream or ""
    lossy = any(
        problem.cause == "wrong_dtype" and problem.stream == stream and not problem.is_lossless
        for problem in facts.layout.problems
    )
    of_type = (Hypothesis("wrong_dtype", stream, support("integrity.values_of_lossy_type")),) if lossy else ()
    return (*of_type, *over_all_rates(alarm.statistic, _of_values))


def propose_layout(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the causes of defects of the layout; each problem names its cause."""
    return over_all_rates(alarm.statistic, _of_layout)


def propose_readable(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return damage as the cause of chunks that do not decode, or another form where all of them are sound."""
    return over_all_rates(alarm.statistic, _of_chunks)


def propose_resolution(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the rounding of values as the cause of their coarse step."""
    return over_all_rates(alarm.statistic, _of_steps)


def _of_steps(statistic: Statistic) -> tuple[Hypothesis, ...]:
    return (Hypothesis("quantised_values", statistic.where.stream or "", support("integrity.coarse_step")),)


def _of_values(statistic: Statistic) -> tuple[Hypothesis, ...]:
    stream = statistic.where.stream or ""
    rule = statistic.code.rpartition(".")[2]
    if rule == "infinite":
        return (Hypothesis("invalid_encoding", stream, support("integrity.infinite")),)
    if rule != "outside_range":
        return (Hypothesis("nan_in_stream", stream, support("integrity.not_a_number"), statistic.value, "samples"),)
    values = next((feature for feature in statistic.features if isinstance(feature, OutOfRange)), None)
    if values is None:
        return (
            Hypothesis("invalid_encoding", stream, support("integrity.flow_too_long")),
            Hypothesis("corrupt_chunk", stream, support("integrity.flow_too_long_by_damage")),
        )
    # Depth: metres read as millimetres if that explains the values; one constant is a code; scattered ones, either.
    to_metres = 1 / MM_PER_M
    if values.in_range_times_1000 > _MOST * values.finite:
        return (Hypothesis("unit_mm_m", "depth", support("integrity.depth_all_in_metres"), to_metres, "1"),)
    if values.constant:
        return (Hypothesis("invalid_encoding", "depth", support("integrity.depth_one_value")),)
    if values.in_range_times_1000 > _MOST * values.outside:  # a part of the file, or of the image
        return (
            Hypothesis("unit_mm_m", "depth", support("integrity.depth_part_in_metres"), to_metres, "1"),
            Hypothesis("invalid_encoding", "depth", support("integrity.depth_part_is_a_code")),
        )
    # Of two units: the one that multiplying by 1000 undoes explains the values where most of them fall into the range.
    is_in_metres = 2 * values.in_range_times_1000 > values.outside
    factor = to_metres if is_in_metres else None
    of_code = support("integrity.depth_beside_range" if values.continue_range else "integrity.depth_by_code")
    return (
        Hypothesis("invalid_encoding", "depth", of_code),
        Hypothesis("unit_mm_m", "depth", support("integrity.depth_by_unit"), factor, "1" if is_in_metres else ""),
    )


def _of_layout(statistic: Statistic) -> tuple[Hypothesis, ...]:
    return tuple(
        Hypothesis(problem.cause, problem.stream, support("integrity.layout_problem"), problem.magnitude)
        for problem in (feature.problem for feature in statistic.features if isinstance(feature, LayoutDefect))
    )


def _of_chunks(statistic: Statistic) -> tuple[Hypothesis, ...]:
    stream = statistic.where.stream or ""
    rows = next((feature for feature in statistic.features if isinstance(feature, RowsOfOtherForm)), None)
    if rows is not None and rows.sound == rows.of:
        return (Hypothesis("wrong_shape", stream, support("integrity.of_other_form")),)
    return (Hypothesis("corrupt_chunk", stream, support("integrity.undecodable"), statistic.value, "chunks"),)
