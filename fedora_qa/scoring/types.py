"""The document of a score. Programs rely on the names of fields: they never change within a version.

Every error is over *scored* values: those whose truth is valid and which have a prediction. ``coverage`` is their share
of the valid ones, 0 to 1. Values that nothing determines are None.
"""

from dataclasses import dataclass
from typing import Final, Literal

from pydantic import TypeAdapter

from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.types import Tool

SCORE_VERSION: Final = "1.0"

Split = Literal["all", "depth", "edges", "motion"]
"""By what pixels are divided into parts; ``all`` has one."""

Metric = Literal["ATE", "RPE"]
Relation = Literal["translation", "rotation"]
Alignment = Literal["none", "rigid", "similarity"]


@dataclass(frozen=True, slots=True)
class ErrorAtTime:
    """The mean error of some successive rows, from the first to the last of their timestamps, us."""

    start_us: int
    stop_us: int
    error: float


@dataclass(frozen=True, slots=True)
class FlowAccuracy:
    """Errors of flow over a part of the pixels.

    ``naee`` is ``aee_px / mean_flow_px``. ``above_1px``, ``above_2px``, ``above_3px`` and ``outliers`` (above 3 px and
    5%) are shares, 0 to 1.
    """

    split: Split
    part: str
    valid_pixels: int
    scored_pixels: int
    coverage: float | None
    aee_px: float | None
    mean_flow_px: float | None
    mean_predicted_flow_px: float | None
    naee: float | None
    above_1px: float | None
    above_2px: float | None
    above_3px: float | None
    outliers: float | None
    angular_error_deg: float | None


@dataclass(frozen=True, slots=True)
class FlowScore:
    """Flow at one rate: all pixels first, then parts of them. Errors over time are average endpoint errors, px."""

    stream: str
    rate_hz: float
    fields: int
    predicted_fields: int
    parts: tuple[FlowAccuracy, ...]
    over_time: tuple[ErrorAtTime, ...]


@dataclass(frozen=True, slots=True)
class DepthAccuracy:
    """Errors of depth, and of disparity, its reciprocal in 1/m, over a part of the pixels.

    ``nade`` is ``ade_per_m / mean_disparity_per_m``. ``mean_log_error`` is the mean of ln(predicted / true); a
    prediction in a wrong unit has a large one. ``within_1_25`` is the share within a factor of 1.25.
    """

    split: Split
    part: str
    valid_pixels: int
    scored_pixels: int
    coverage: float | None
    ade_per_m: float | None
    mean_disparity_per_m: float | None
    nade: float | None
    abs_rel: float | None
    rmse_m: float | None
    log_rmse: float | None
    mean_log_error: float | None
    within_1_25: float | None


@dataclass(frozen=True, slots=True)
class DepthScore:
    """Depth: all pixels first, then parts of them. Errors over time are normalised errors of disparity (NADE)."""

    frames: int
    predicted_frames: int
    parts: tuple[DepthAccuracy, ...]
    over_time: tuple[ErrorAtTime, ...]


@dataclass(frozen=True, slots=True)
class NormalisedPoseError:
    """``nae = mean_error / mean_truth``, both in ``unit``, of poses or of motions from each to the next."""

    quantity: str
    unit: str
    mean_error: float
    mean_truth: float
    nae: float | None


@dataclass(frozen=True, slots=True)
class TrajectoryError:
    """Statistics of ATE or RPE, in ``unit``, over ``count`` poses or pairs; a pair lies ``delta_poses`` apart."""

    metric: Metric
    relation: Relation
    unit: str
    alignment: Alignment
    delta_poses: int | None
    count: int
    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float


@dataclass(frozen=True, slots=True)
class PoseScore:
    """Poses of the body in the world. Errors over time are distances of positions as predicted, m."""

    poses: int
    scored_poses: int
    coverage: float | None
    normalised: tuple[NormalisedPoseError, ...]
    errors: tuple[TrajectoryError, ...]
    over_time: tuple[ErrorAtTime, ...]


@dataclass(frozen=True, slots=True)
class Score:
    """The whole document. What was not predicted is None, or has no entry in ``flow``."""

    score_version: str
    tool: Tool
    predictions: str
    sequence: str
    flow: tuple[FlowScore, ...]
    depth: DepthScore | None
    pose: PoseScore | None
    notes: tuple[str, ...]


SCORE: Final = DocumentKind(
    name="score",
    noun="a score",
    version=SCORE_VERSION,
    adapter=TypeAdapter(Score),
    written_by="fedora-qa score --json",
    again="score again with this version",
)
