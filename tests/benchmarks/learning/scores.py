"""Predictions of flights, written in canonical keys and scored by ``fedora_qa.score``."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa import score
from fedora_qa.conventions import MM_PER_M
from fedora_qa.scoring.types import Score
from tests.benchmarks.learning.budget import COLOUR_SIZE
from tests.benchmarks.learning.samples import Targets, chained


@dataclass(frozen=True, slots=True)
class Errors:
    """Normalised errors over some flights: the average error of all values over their average truth.

    Attributes
    ----------
    naee, nade
        Of flow and disparity.
    nae_position, nae_orientation
        Of the motion from each interval's start to its end.
    aee_px, mean_flow_px
        What NAEE is a ratio of.
    ade_per_m, mean_disparity_per_m
        What NADE is a ratio of.
    """

    naee: float
    nade: float
    nae_position: float
    nae_orientation: float
    aee_px: float
    mean_flow_px: float
    ade_per_m: float
    mean_disparity_per_m: float

    def to_json(self) -> dict[str, float]:
        """Return the values by name."""
        return asdict(self)


def errors_of(predictions: Iterable[Targets], paths: Sequence[Path], rate_hz: int, folder: Path) -> Errors:
    """Score the predictions of some files.

    Parameters
    ----------
    predictions
        Of each file, for the intervals of its flow.
    paths
        The correct files.
    rate_hz
        The rate of the flow.
    folder
        Where predictions are written while they are scored.
    """
    scores = []
    for predicted, path in zip(predictions, paths, strict=True):
        target = folder / "predictions.h5"
        write_predictions(predicted, path, rate_hz, target)
        scores.append(score(target, path))
        target.unlink()
    return pooled(scores)


def pooled(scores: Sequence[Score]) -> Errors:
    """Return the errors over the values of all scores together."""
    sums: dict[str, float] = {}

    def add(name: str, mean: float | None, count: int) -> None:
        if mean is not None:
            sums[name] = sums.get(name, 0.0) + mean * count
            sums[f"{name} count"] = sums.get(f"{name} count", 0.0) + count

    for each in scores:
        (flow,) = each.flow
        if each.depth is None or each.pose is None:
            raise ValueError("Expected scores of flow, depth and pose, got one without")
        whole_flow, whole_depth = flow.parts[0], each.depth.parts[0]
        add("aee", whole_flow.aee_px, whole_flow.scored_pixels)
        add("flow", whole_flow.mean_flow_px, whole_flow.scored_pixels)
        add("ade", whole_depth.ade_per_m, whole_depth.scored_pixels)
        add("disparity", whole_depth.mean_disparity_per_m, whole_depth.scored_pixels)
        for row in each.pose.normalised:
            add(f"{row.quantity} error", row.mean_error, each.pose.scored_poses - 1)
            add(f"{row.quantity} truth", row.mean_truth, each.pose.scored_poses - 1)
    return Errors(
        naee=sums["aee"] / sums["flow"],
        nade=sums["ade"] / sums["disparity"],
        nae_position=sums["motion position error"] / sums["motion position truth"],
        nae_orientation=sums["motion orientation error"] / sums["motion orientation truth"],
        aee_px=sums["aee"] / sums["aee count"],
        mean_flow_px=sums["flow"] / sums["flow count"],
        ade_per_m=sums["ade"] / sums["ade count"],
        mean_disparity_per_m=sums["disparity"] / sums["disparity count"],
    )


def write_predictions(predicted: Targets, path: Path, rate_hz: int, target: Path) -> None:
    """Write predictions of a file's intervals, enlarged to the colour camera; poses chain from the true first one."""
    with h5py.File(path) as file, h5py.File(target, "w") as out:
        intervals_us = file[f"path/flow/{rate_hz}hz_ts"][: len(predicted.motion)]
        out[f"path/flow/{rate_hz}hz_ts"] = intervals_us
        out[f"path/flow/{rate_hz}hz"] = np.stack([enlarged(np.moveaxis(field, 0, -1)) for field in predicted.flow_px])
        out["path/depth_ts"] = intervals_us[:, 0]
        out["path/depth"] = np.stack([MM_PER_M / enlarged(image) for image in predicted.disparity_per_m])
        first = int(np.searchsorted(file["path/pose/ts"][:], intervals_us[0, 0]))
        out["path/pose/ts"] = np.append(intervals_us[:, 0], intervals_us[-1, 1])
        out["path/pose/position"], out["path/pose/orientation"] = chained(
            file["path/pose/position"][first], file["path/pose/orientation"][first], predicted.motion.astype(np.float64)
        )


def enlarged(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return an image of the event camera at the size of the colour camera, bilinear between pixel centres."""
    return np.asarray(cv2.resize(image, COLOUR_SIZE, interpolation=cv2.INTER_LINEAR))


def trivial_predictions(training: Targets, intervals: int) -> Mapping[str, Targets]:
    """Return predictions that do not look at events.

    *zero* is no motion, and the mean disparity as one number; *constant* the mean flow vector, disparity and motion of
    the training set; *mean field* the mean of each pixel.
    """
    shape = training.flow_px.shape[1:]
    mean_flow = np.nanmean(training.flow_px, axis=(0, 2, 3))[:, None, None]
    mean_disparity = float(np.nanmean(training.disparity_per_m))
    mean_motion = training.motion.mean(axis=0)
    fields = {
        "zero": (np.zeros(shape), np.full(shape[1:], mean_disparity), np.zeros_like(mean_motion)),
        "constant": (np.broadcast_to(mean_flow, shape), np.full(shape[1:], mean_disparity), mean_motion),
        "mean field": (
            _mean_or(training.flow_px, mean_flow),
            _mean_or(training.disparity_per_m, mean_disparity),
            mean_motion,
        ),
    }
    return {
        name: Targets(*(np.repeat(np.asarray(value, np.float32)[None], intervals, axis=0) for value in values))
        for name, values in fields.items()
    }


def _mean_or(images: NDArray[np.float32], otherwise: NDArray[np.float32] | float) -> NDArray[np.float64]:
    """Return the mean of each pixel over images (n, ...), or another value where none is valid."""
    valid = np.isfinite(images)
    count = valid.sum(axis=0)
    return np.where(count > 0, np.where(valid, images, 0).sum(axis=0) / np.maximum(count, 1), otherwise)
