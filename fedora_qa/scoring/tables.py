"""A score as tables of text, the same in the terminal, in markdown and in the report."""

from collections.abc import Iterator, Sequence
from typing import Final

from fedora_qa.record.markdown import escape, table_section
from fedora_qa.record.tables import ABSENT, TextTable, number_cell
from fedora_qa.record.wording import number
from fedora_qa.scoring.types import Alignment, DepthScore, FlowScore, PoseScore, Score

ALIGNMENT_WORDS: Final[dict[Alignment, str]] = {
    "none": "as predicted",
    "rigid": "moved as a whole",
    "similarity": "moved and scaled as a whole",
}

_FLOW_NOTE: Final = (
    "AEE: average endpoint error. NAEE: AEE / mean length of true flow; zero flow has 1. Shares of the scored pixels "
    "that err by more than 1, 2, 3 px, and by more than 3 px and 5% of the true flow. Angle between (u, v, 1) of both."
)
_DEPTH_NOTE: Final = (
    "ADE: average error of disparity, 1/Z. NADE: ADE / mean true disparity; the same for disparity in px. AbsRel, RMSE "
    "and log RMSE of depth; share within a factor of 1.25."
)
_POSE_NOTE: Final = (
    "ATE of poses, RPE of the motion from each pose to one of a later row, as evo computes them. Moved as a whole: by "
    "the rotation and translation that bring the paths together."
)
_NORMALISED_NOTE: Final = (
    "NAE: average error / mean true value. That of poses depends on the origin and axes of the world; that of motions, "
    "each from a pose to the next, does not."
)


def headline(score: Score) -> str:
    """Return ``headlines`` in one line."""
    return "; ".join(headlines(score)) or "Nothing of the truth is valid"


def headlines(score: Score) -> tuple[str, ...]:
    """Return the main error of each stream, with its coverage."""
    parts = []
    for flow in score.flow:
        if flow.parts:
            parts.append(f"{flow.stream}: NAEE {number_cell(flow.parts[0].naee)}, {_covered(flow.parts[0].coverage)}")
    if score.depth and score.depth.parts:
        parts.append(f"depth: NADE {number_cell(score.depth.parts[0].nade)}, {_covered(score.depth.parts[0].coverage)}")
    if score.pose:
        errors = [error.rmse for error in score.pose.errors if error.metric == "ATE" and error.unit == "m"]
        ate = f"{number(errors[0])} m" if errors else ABSENT
        parts.append(f"pose: ATE {ate}, {_covered(score.pose.coverage)}")
    return tuple(parts)


def score_tables(score: Score) -> tuple[TextTable, ...]:
    """Return the tables of every stream that was predicted."""
    tables = list(flow_tables(score.flow))
    if score.depth:
        tables.append(depth_table(score.depth))
    if score.pose:
        tables += pose_tables(score.pose)
    return tuple(tables)


def score_to_markdown(score: Score) -> str:
    """Return a score as GitHub-flavoured markdown."""
    parts = [
        "# Score",
        f"{escape(score.predictions)} against {escape(score.sequence)}",
        f"**{escape(headline(score))}**",
    ]
    parts += [f"- {escape(note)}" for note in score.notes]
    parts += [table_section(source) for source in score_tables(score)]
    return "\n\n".join([*parts, f"<sub>{escape(f'{score.tool.name} {score.tool.version}')}</sub>"]) + "\n"


def flow_tables(flows: Sequence[FlowScore]) -> Iterator[TextTable]:
    """Yield a table for each rate of flow, a row for each part of the pixels; the first has the definitions."""
    head = ("pixels", "covered (%)", "AEE (px)", "mean (px)", "NAEE", "> 1 px (%)", "> 2 px (%)", "> 3 px (%)",
            "> 3 px, 5% (%)", "angle (deg)")  # fmt: skip
    for place, flow in enumerate(flows):
        rows = tuple(
            (
                part.part,
                number_cell(part.coverage, 100.0),
                *map(number_cell, (part.aee_px, part.mean_flow_px, part.naee)),
                *(
                    number_cell(share, 100.0)
                    for share in (part.above_1px, part.above_2px, part.above_3px, part.outliers)
                ),
                number_cell(part.angular_error_deg),
            )
            for part in flow.parts
        )
        counted = f"{flow.predicted_fields} of {flow.fields} fields are predicted."
        note = counted if place else f"{counted} {_FLOW_NOTE}"
        yield TextTable(f"Flow at {flow.rate_hz:g} Hz", head, rows, note, words=1)


def depth_table(depth: DepthScore) -> TextTable:
    """Return depth and disparity, a row for each part of the pixels."""
    head = (
        "pixels",
        "covered (%)",
        "ADE (1/m)",
        "mean (1/m)",
        "NADE",
        "AbsRel",
        "RMSE (m)",
        "log RMSE",
        "δ < 1.25 (%)",
    )
    rows = tuple(
        (
            part.part,
            number_cell(part.coverage, 100.0),
            *map(number_cell, (part.ade_per_m, part.mean_disparity_per_m, part.nade)),
            *map(number_cell, (part.abs_rel, part.rmse_m, part.log_rmse)),
            number_cell(part.within_1_25, 100.0),
        )
        for part in depth.parts
    )
    counted = f"{depth.predicted_frames} of {depth.frames} frames are predicted."
    return TextTable("Depth and disparity", head, rows, f"{counted} {_DEPTH_NOTE}", words=1)


def pose_tables(pose: PoseScore) -> Iterator[TextTable]:
    """Yield the normalised errors of poses, then ATE and RPE."""
    counted = f"{pose.scored_poses} of {pose.poses} poses are predicted."
    yield TextTable(
        "Pose, normalised",
        ("of", "unit", "mean error", "mean truth", "NAE"),
        tuple(
            (error.quantity, error.unit, number(error.mean_error), number(error.mean_truth), number_cell(error.nae))
            for error in pose.normalised
        ),
        f"{counted} {_NORMALISED_NOTE}",
    )
    yield TextTable(
        "Trajectory",
        ("error", "unit", "RMSE", "mean", "median", "std", "min", "max"),
        tuple(
            (
                f"{error.metric} of {error.relation}, "
                + (
                    ALIGNMENT_WORDS[error.alignment]
                    if error.delta_poses is None
                    else f"over {_steps(error.delta_poses)}"
                ),
                error.unit,
                *map(number, (error.rmse, error.mean, error.median, error.std, error.min, error.max)),
            )
            for error in pose.errors
        ),
        _POSE_NOTE,
    )


def _steps(count: int) -> str:
    return f"{count} pose{'' if count == 1 else 's'}"


def _covered(coverage: float | None) -> str:
    return f"{number_cell(coverage, 100.0)}% covered"
