"""Errors of optical flow: endpoint error, its normalised form, outliers, and the angular error.

Sources
-------
Endpoint error and average (AEE): M. Otte, H.-H. Nagel, Optical flow estimation: advances and comparisons (ECCV 1994);
    S. Baker et al., A database and evaluation methodology for optical flow (IJCV 92, 2011).
Normalised average endpoint error (NAEE): A. Joshi et al., FEDORA: A Flying Event Dataset fOr Reactive behAvior.
Share above N px: M. Gehrig et al., E-RAFT: Dense optical flow from event cameras (3DV 2021), as the DSEC benchmark.
Share above 3 px and 5%: M. Menze, A. Geiger, Object scene flow for autonomous vehicles (CVPR 2015), KITTI's ``Fl``.
Angular error: J. L. Barron, D. J. Fleet, S. S. Beauchemin, Performance of optical flow techniques (IJCV 12, 1994).
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.scoring.error_sums import Float64, PartKey, share
from fedora_qa.scoring.types import FlowAccuracy

OUTLIER_PX: Final = 3.0
OUTLIER_SHARE: Final = 0.05
"""KITTI's outlier errs by more than 3 px and by more than 5% of the true flow."""


def flow_errors(truth_px: NDArray[Any], predicted_px: NDArray[Any]) -> tuple[dict[str, Float64], NDArray[np.bool_]]:
    """Return the errors of a flow field, to be summed.

    Parameters
    ----------
    truth_px, predicted_px
        (H, W, 2) displacement, px, (u right, v down). A pixel is valid where the truth is finite, and scored where the
        prediction is as well.

    Returns
    -------
    values
        (n,) by quantity, of the valid pixels; 0 where there is no prediction, but for ``valid``.
    valid
        (H, W) the valid pixels.
    """
    valid = np.isfinite(truth_px).all(axis=-1)
    u, v = np.moveaxis(truth_px[valid].astype(np.float64), -1, 0)
    u_predicted, v_predicted = np.moveaxis(predicted_px[valid].astype(np.float64), -1, 0)
    scored = np.isfinite(u_predicted) & np.isfinite(v_predicted)
    # What is not scored counts nowhere: truth and prediction are 0 there.
    u, v, u_predicted, v_predicted = (np.where(scored, part, 0.0) for part in (u, v, u_predicted, v_predicted))
    length_px = np.sqrt(u**2 + v**2)
    # EE = |f_predicted - f|
    error_px = np.sqrt((u_predicted - u) ** 2 + (v_predicted - v) ** 2)
    # AE is the angle between (u, v, 1) and (u_predicted, v_predicted, 1). Its arctangent keeps small angles exact,
    # which the usual arccosine of the normalised product loses.
    cross = np.sqrt(error_px**2 + (u * v_predicted - v * u_predicted) ** 2)
    angle_deg = np.degrees(np.arctan2(cross, u * u_predicted + v * v_predicted + 1.0))
    values = {
        "valid": np.ones(len(u)),
        "scored": scored.astype(np.float64),
        "error_px": error_px,
        "length_px": length_px,
        "predicted_length_px": np.sqrt(u_predicted**2 + v_predicted**2),
        "above_1px": (error_px > 1).astype(np.float64),
        "above_2px": (error_px > 2).astype(np.float64),
        "above_3px": (error_px > 3).astype(np.float64),
        "outliers": ((error_px > OUTLIER_PX) & (error_px > OUTLIER_SHARE * length_px)).astype(np.float64),
        "angle_deg": angle_deg,
    }
    return values, valid


def flow_accuracy(key: PartKey, totals: Mapping[str, float]) -> FlowAccuracy:
    """Return the accuracy over a part of the pixels from the totals of ``flow_errors``."""
    scored = totals["scored"]
    return FlowAccuracy(
        split=key[0],
        part=key[1],
        valid_pixels=round(totals["valid"]),
        scored_pixels=round(scored),
        coverage=share(scored, totals["valid"]),
        aee_px=share(totals["error_px"], scored),
        mean_flow_px=share(totals["length_px"], scored),
        mean_predicted_flow_px=share(totals["predicted_length_px"], scored),
        # NAEE = AEE / mean |f|, both over the scored pixels
        naee=share(totals["error_px"], totals["length_px"]),
        above_1px=share(totals["above_1px"], scored),
        above_2px=share(totals["above_2px"], scored),
        above_3px=share(totals["above_3px"], scored),
        outliers=share(totals["outliers"], scored),
        angular_error_deg=share(totals["angle_deg"], scored),
    )
