"""What all fields of a rate together say of the flow against the frames: each template with its error and bias."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.fitting.few_groups import student_factor
from fedora_qa.estimators.flow.field_fit import (
    GAIN,
    GEOMETRIC,
    MEAN,
    beyond_chance,
    gain_of_true,
    lock_in,
    robust_errors,
)
from fedora_qa.estimators.flow.motion_fit import Evidence, sum_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_intervals import place
from fedora_qa.views.flow_residuals import FieldResidual

Float64 = NDArray[np.float64]

_BIAS_PX: Final = 0.005
"""Largest amplitude of the bias that aliases and interpolation give the estimate, as the sine of 2 pi times the flow.

`flow_field_fit.lock_in` derives the law; the amplitude is (energy at 2 pi - w over that at w) / w, averaged with the
weight w^2 E(w) exp(-w^2) of the smoothed image. For a box-shaped pixel and amplitudes that fall as 1/frequency (edges
do), the ratio is (w / (2 pi - w))^4: 0.0013 px at 1 rad/px, 0.0008 px in the mean; the spline read adds at most 0.0005
px (see its test). 0.005 px leaves room for steeper mixes. For white noise, which no scene is, it would be 0.03 px.
"""

_GEOMETRIC: Final = (
    ("focal", "percent", "its focal length were too large"),
    ("centre_u", "px", "its principal point lay too far right"),
    ("centre_v", "px", "its principal point lay too far down"),
    ("mounting_pitch", "deg", "its camera were turned about the axis that points right"),
    ("mounting_yaw", "deg", "its camera were turned about the axis that points down"),
    ("mounting_roll", "deg", "its camera were turned about the optical axis"),
    ("time", "percent", "it came too late, in percent of its interval,"),
    ("roll", "deg", "the camera had rolled further within each interval"),
)
"""Name, unit and meaning of each geometric template."""

_BLIND: Final = 1e3
"""Standard errors, in the unit of a template, beyond which nothing moves that could show it."""

MATTERS_PX: Final = 0.5
_MATTERS_PERCENT: Final = 10.0


@dataclass(frozen=True, slots=True)
class Estimate:
    """Sizes (p,) fitted to all fields of a rate, their standard errors, and the bias that aliases may give them."""

    sizes: Float64
    errors: Float64
    biases: Float64

    def scaled(self, factor: float) -> "Estimate":
        """Return the estimate in another unit."""
        return Estimate(factor * self.sizes, factor * self.errors, factor * self.biases)


@dataclass(frozen=True, slots=True)
class RateEstimate:
    """All fields of one rate together: mean residual (u, v) in px; gain, 1 is 100%; and what else templates tell."""

    mean: Estimate
    gain: Estimate
    geometric: Estimate | None


def estimate_rate(fields: Sequence[FieldResidual]) -> RateEstimate | None:
    """Gather the fields of one rate; None where in none of them enough tiles match.

    Mean and gain are each fitted alone, and so is each geometric template: a fault is one of them, not all at once.
    """
    told = [(one.evidence, scale) for one, scale in zip(fields, scales_of(fields), strict=True) if one.evidence]
    if not told:
        return None
    evidences, scales = [one for one, _ in told], [scale for _, scale in told]
    total = sum_of(evidences)
    gain = _solved(evidences, total, GAIN, scales)
    of_true, slope = gain_of_true(float(gain.sizes[0]))
    alone = [
        _solved(evidences, total, slice(column, column + 1), scales)
        for column in range(GEOMETRIC.start, GEOMETRIC.stop)
    ]
    known = total.matrix[GEOMETRIC, GEOMETRIC].any()
    return RateEstimate(
        mean=_solved(evidences, total, MEAN, scales),
        gain=Estimate(np.array([of_true]), slope * gain.errors, slope * gain.biases),
        geometric=_joined(alone) if known else None,
    )


def scales_of(fields: Sequence[FieldResidual]) -> list[float]:
    """Return the factor by which formal errors of each field are to be multiplied, from how far its tiles scatter.

    The median over fields, that none which is off counts; that of a chi-square of f degrees of freedom over f is
    (1 - 2 / 9 f)^3 (Wilson and Hilferty, 1931). Fields may differ: two equal frames leave no residual at all, and
    others of the same rate that of a fast turn. Where one scatters by more than the median explains, its own counts.
    """
    known = [one for one in fields if one.freedom > 0]
    if not known:
        return [1.0] * len(fields)
    usual = float(np.median([one.spread / (1 - 2 / (9 * one.freedom)) ** 3 for one in known]))
    together = student_factor(sum(one.freedom for one in known)) * float(np.sqrt(usual))

    def scale(one: FieldResidual) -> float:
        if one.freedom > 0 and one.spread > usual * beyond_chance(one.freedom):
            return max(together, student_factor(one.freedom) * float(np.sqrt(one.spread)))
        return together

    return [scale(one) for one in fields]


def _solved(evidences: Sequence[Evidence], total: Evidence, columns: slice, scales: Sequence[float]) -> Estimate:
    """Fit some templates alone to all fields; fields are the blocks of the empirical error."""
    matrix = total.matrix[columns, columns]
    matrix = matrix + np.eye(len(matrix)) * (1e-12 * np.trace(matrix) + 1e-12)
    sizes = np.linalg.solve(matrix, total.vector[columns])
    scores = np.array([one.vector[columns] - one.matrix[columns, columns] @ sizes for one in evidences])
    scatter = np.sum([s**2 * one.matrix[columns, columns] for one, s in zip(evidences, scales, strict=True)], axis=0)
    return Estimate(sizes, robust_errors(matrix, scatter, scores), _BIAS_PX * lock_in(total, columns))


def _joined(estimates: Sequence[Estimate]) -> Estimate:
    return Estimate(
        np.concatenate([one.sizes for one in estimates]),
        np.concatenate([one.errors for one in estimates]),
        np.concatenate([one.biases for one in estimates]),
    )


def rate_measurements(
    stream: str,
    fields: Sequence[FieldResidual],
    rate: RateEstimate | None,
    facts: Facts,
    suspects: tuple[Suspect, ...],
) -> list[Statistic]:
    """State a rate's mean residual flow and its gain."""
    if rate is None:
        return []
    where = place(facts, (fields[0].interval, fields[-1].interval))

    def measured(
        name: str, estimate: Estimate, at: int, unit: str, rule: str, statement: str, material: float | None
    ) -> Statistic:
        return Statistic(
            name=f"{stream} {name}",
            value=float(estimate.sizes[at]),
            unit=unit,
            standard_error=float(estimate.errors[at]),
            model_error_bound=float(estimate.biases[at]),
            material=material,
            statement=statement,
            code=f"flow_photometric.residual.{rule}",
            where=where,
            suspects=suspects,
        )

    mean_px, percent = rate.mean.sizes, 100 * float(rate.gain.sizes[0])
    found = [
        measured(f"residual_{axis}", rate.mean, i, "px", "mean",
                 f"{stream} carries frames {abs(mean_px[i]):.3g} px too far "
                 f"{('right', 'down')[i] if mean_px[i] > 0 else ('left', 'up')[i]} on average.", MATTERS_PX)
        for i, axis in enumerate("uv")
    ]  # fmt: skip
    found.append(
        measured("gain", rate.gain.scaled(100), 0, "percent", "gain",
                 f"{stream} is {abs(percent):.3g}% too {'large' if percent > 0 else 'small'} for the frames.",
                 _MATTERS_PERCENT)
    )  # fmt: skip
    if rate.geometric is not None:
        found += [
            measured(name, rate.geometric, at, unit, "template",
                     f"{stream} leads off the frames as if {meaning} by {rate.geometric.sizes[at]:.3g} {unit}.", None)
            for at, (name, unit, meaning) in enumerate(_GEOMETRIC) if np.isfinite(rate.geometric.errors[at])
            and rate.geometric.errors[at] < _BLIND
        ]  # fmt: skip
    return found
