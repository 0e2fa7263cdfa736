"""Errors of depth, and of disparity, which is its reciprocal.

A stereo pair of baseline B sees the disparity f B / Z in px. So the normalised error of 1 / Z is that of a disparity in
px as well.

Sources
-------
Average disparity error, and its normalised form (NADE): A. Joshi et al., FEDORA: A Flying Event Dataset fOr Reactive
    behAvior.
AbsRel, RMSE, log RMSE and the share within a factor of 1.25: D. Eigen, C. Puhrsch, R. Fergus, Depth map prediction from
    a single image using a multi-scale deep network (NeurIPS 2014).
"""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.scoring.error_sums import Float64, PartKey, share
from fedora_qa.scoring.types import DepthAccuracy

WITHIN_FACTOR: Final = 1.25


def depth_errors(truth_m: NDArray[Any], predicted_m: NDArray[Any]) -> tuple[dict[str, Float64], NDArray[np.bool_]]:
    """Return the errors of a depth frame, to be summed.

    Parameters
    ----------
    truth_m, predicted_m
        (H, W) z-depth, m. A pixel is valid where the truth is finite and above 0, and scored where the prediction is as
        well.

    Returns
    -------
    values
        (n,) by quantity, of the valid pixels; 0 where there is no prediction, but for ``valid``.
    valid
        (H, W) the valid pixels.
    """
    valid = is_depth(truth_m)
    truth, predicted = truth_m[valid].astype(np.float64), predicted_m[valid].astype(np.float64)
    scored = is_depth(predicted)
    # What is not scored counts nowhere: the prediction is the truth there, and the truth's own sum leaves it out.
    predicted = np.where(scored, predicted, truth)
    log_error = np.log(predicted / truth)
    values = {
        "valid": np.ones(len(truth)),
        "scored": scored.astype(np.float64),
        "disparity_error_per_m": np.abs(1.0 / predicted - 1.0 / truth),
        "disparity_per_m": np.where(scored, 1.0 / truth, 0.0),
        "relative_error": np.abs(predicted - truth) / truth,
        "squared_error_m2": (predicted - truth) ** 2,
        "log_error": log_error,
        "squared_log_error": log_error**2,
        # The ratio is max(Z_predicted / Z, Z / Z_predicted).
        "within_factor": (scored & (np.maximum(predicted / truth, truth / predicted) < WITHIN_FACTOR)).astype(
            np.float64
        ),
    }
    return values, valid


def depth_accuracy(key: PartKey, totals: Mapping[str, float]) -> DepthAccuracy:
    """Return the accuracy over a part of the pixels from the totals of ``depth_errors``."""
    scored = totals["scored"]
    return DepthAccuracy(
        split=key[0],
        part=key[1],
        valid_pixels=round(totals["valid"]),
        scored_pixels=round(scored),
        coverage=share(scored, totals["valid"]),
        ade_per_m=share(totals["disparity_error_per_m"], scored),
        mean_disparity_per_m=share(totals["disparity_per_m"], scored),
        # NADE = ADE / mean (1 / Z), both over the scored pixels
        nade=share(totals["disparity_error_per_m"], totals["disparity_per_m"]),
        abs_rel=share(totals["relative_error"], scored),
        rmse_m=_root(share(totals["squared_error_m2"], scored)),
        log_rmse=_root(share(totals["squared_log_error"], scored)),
        mean_log_error=share(totals["log_error"], scored),
        within_1_25=share(totals["within_factor"], scored),
    )


def is_depth(depth: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where depth is finite and above 0."""
    return np.asarray(np.isfinite(depth) & (depth > 0))


def _root(mean_square: float | None) -> float | None:
    return None if mean_square is None else math.sqrt(mean_square)
