"""Statistics and features of one rate of flow against the frames: all its fields together, and its worst ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Statistic
from fedora_qa.estimators.fitting.robust import sensitivity_range
from fedora_qa.estimators.fitting.tails import chance_of_largest
from fedora_qa.estimators.flow.field_fit import (
    CENTRE,
    FOCAL,
    GAIN,
    MEAN,
    MOUNTING,
    SHIFT,
    TIME,
    RateFit,
    TemplateSizes,
    error_scales,
    fit_rate,
    gain_on_true_flow,
    have_common_gain,
    own_mean_share,
)
from fedora_qa.estimators.flow.parameter_templates import sum_of
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_intervals import place
from fedora_qa.views.flow_residuals import UNMATCHED, FieldResidual

_FIELD_BIAS_PX: Final = 0.02
"""Bias by aliasing in a single field, px: four times that of a rate, since its few tiles may all have one steep
texture."""

_TILE_BIAS_PX: Final = 0.2
"""The same for a single tile: unresolved detail at grazing angles, and surfaces that meet without an edge of depth.

The tile's own error includes neither: it is estimated from the residuals as noise. In ray-cast scenes one tile of
10,000 exceeds its error by up to 0.1 px (three scenes, 50,000 tiles); twice that is the bound.
"""

UNMATCHED_SHARE: Final = 0.1
"""Largest share of one field's tiles that may not match: reflections, shadows, occlusions without depth."""

_MANY_TILES: Final = 10
"""Least number of textured tiles of a field for a share of unmatched ones."""

SIGNIFICANT_SIGMAS: Final = 6.0
"""Standard errors of a deviation above which a follow-up is made; judgement applies its own limit."""


_GEOMETRIC: Final = (
    ("focal", "percent", "the focal length were too large"),
    ("centre_u", "px", "the principal point were too far right"),
    ("centre_v", "px", "the principal point were too far down"),
    ("mounting_pitch", "deg", "the camera were rotated about its x axis (right)"),
    ("mounting_yaw", "deg", "the camera were rotated about its y axis (down)"),
    ("mounting_roll", "deg", "the camera were rotated about its optical axis"),
    ("time", "percent", "its timestamps were too late, in percent of its interval,"),
    ("roll", "deg", "the camera had rolled more within each interval"),
)
"""Name, unit and meaning of each geometric template."""

_UNDETERMINED: Final = 1e3
"""Largest standard error of a template that is stated, in its unit: a larger one means that the motion does not
determine it."""


@dataclass(frozen=True, slots=True)
class TemplateExplanation(Feature):
    """A template fitted alone to all fields of a rate.

    Attributes
    ----------
    template
        ``gain`` (1 is 100%), ``shift`` (px), ``focal`` (percent), ``centre`` (px), ``mounting`` (deg) or ``time``
        (percent of the interval).
    sizes
        Sizes of its components, in this unit.
    explained_share
        Share of the squared residuals that it explains, 0 to 1.
    standard_error
        Of the gain; None for other templates.
    """

    template: str
    sizes: tuple[float, ...]
    explained_share: float
    standard_error: float | None = None


@dataclass(frozen=True, slots=True)
class RateResidual(Feature):
    """Extent and kind of the residual flow of one rate.

    Attributes
    ----------
    rate
        Stream of the rate.
    deviates_by_rate
        Whether each rate that can be measured deviates significantly from the frames.
    fields, deviating_fields
        Numbers of fields that can be measured, and of those that deviate significantly.
    has_common_gain
        Whether most fields have one gain.
    unmatched_share
        Share of the textured tiles of all fields that do not match.
    interval_s
        Length of a field's interval, s.
    explained_share
        Share of the squared residuals that all templates together explain; 0 where no field has enough tiles.
    own_mean_share
        Share of the explained squares that only a mean of each field explains; 0 where no field deviates significantly.
    chance_of_largest_mean
        Probability that the largest of the fields' means is a draw from the same distribution as the others.
    """

    rate: str
    deviates_by_rate: Mapping[str, bool]
    fields: int
    deviating_fields: int
    has_common_gain: bool
    unmatched_share: float
    interval_s: float
    explained_share: float
    own_mean_share: float
    chance_of_largest_mean: float


def scales_of(fields: Sequence[FieldResidual]) -> list[float]:
    """Return the factor on the formal errors of each field of one rate."""
    return error_scales([field.spread for field in fields], [field.freedom for field in fields])


def fit_fields(fields: Sequence[FieldResidual]) -> RateFit | None:
    """Fit the fields of one rate together; None where in none of them enough tiles match."""
    fitted = [(field.evidence, scale) for field, scale in zip(fields, scales_of(fields), strict=True) if field.evidence]
    return fit_rate([evidence for evidence, _ in fitted], [scale for _, scale in fitted]) if fitted else None


def deviation_ratio(field: FieldResidual) -> float:
    """Return the largest ratio of a field's deviations to their limits: unmatched tiles, mean, gain."""
    # Each deviation over its limit, so that shares and pixels compare: 1 is the limit.
    unmatched = max(field.unmatched_share / UNMATCHED_SHARE, field.least_matched / UNMATCHED)
    if field.evidence is None:
        return unmatched
    error_px = max(field.mean_error_px)
    by_mean = _mean_px(field) / (_field_bias_px(field) + SIGNIFICANT_SIGMAS * error_px)
    # The gain and its formal error in px of the field's typical flow.
    matrix, vector = field.evidence.matrix, field.evidence.vector
    information = max(float(matrix[GAIN, GAIN][0, 0]), 1e-300)
    # Information on the gain is sum w |f|^2, on the mean sum w for u and for v: 2 I / trace is the mean square of the
    # flow f.
    typical_flow_px = float(np.sqrt(2 * information / np.trace(matrix[MEAN, MEAN])))
    gain = abs(float(vector[GAIN][0])) / information
    gain_px, gain_error_px = gain * typical_flow_px, typical_flow_px / float(np.sqrt(information))
    by_gain = gain_px / (_FIELD_BIAS_PX + SIGNIFICANT_SIGMAS * max(gain_error_px, error_px))
    return max(unmatched, by_mean, by_gain)


def deviates(rate: RateFit | None, fields: Sequence[FieldResidual]) -> bool:
    """Whether a rate deviates significantly from the frames, in all its fields or in some.

    Parameters
    ----------
    rate
        Fit of all fields; None where too few tiles match.
    fields
        Measured fields of the rate, one or more.
    """
    if any(deviation_ratio(field) > 1 for field in fields) or rate is None:
        return True
    estimates = [rate.mean, rate.gain, *([rate.geometric] if rate.geometric else [])]
    return any(
        bool(np.any(np.abs(estimate.sizes) > estimate.biases + SIGNIFICANT_SIGMAS * estimate.errors))
        for estimate in estimates
    )


def rate_features(
    stream: str, fields: Sequence[FieldResidual], deviates_by_rate: Mapping[str, bool]
) -> tuple[Feature, ...]:
    """Return the features of the residual flow of one rate.

    Parameters
    ----------
    stream
        ``flow/<rate>hz``.
    fields
        Measured fields of the rate, one or more.
    deviates_by_rate
        Whether each rate deviates, by stream.

    Returns
    -------
    tuple
        A ``RateResidual``, and the explanation of each template where a field has enough matching tiles.
    """
    deviating = sum(deviation_ratio(field) > 1 for field in fields)
    evidences = [field.evidence for field in fields if field.evidence]
    templates: list[TemplateExplanation] = []
    explained_share = 0.0
    if evidences:
        total = sum_of(evidences)
        _, explained_share = total.explained_by(slice(None))
        gain, gain_error, share_of_gain = gain_on_true_flow(total)
        templates.append(TemplateExplanation("gain", (gain,), share_of_gain, gain_error))
        for name, columns in (("shift", SHIFT), ("focal", FOCAL), ("centre", CENTRE), ("mounting", MOUNTING),
                              ("time", TIME)):  # fmt: skip
            sizes, share = total.explained_by(columns)
            templates.append(TemplateExplanation(name, tuple(float(size) for size in sizes), share))
    means_px = np.array([field.mean_px for field in fields])
    errors_px = np.array([field.mean_error_px for field in fields])
    residual = RateResidual(
        rate=stream,
        deviates_by_rate=deviates_by_rate,
        fields=len(fields),
        deviating_fields=deviating,
        has_common_gain=have_common_gain(evidences),
        unmatched_share=sum(field.unmatched for field in fields) / max(sum(field.textured for field in fields), 1),
        interval_s=fields[0].interval.duration_s,
        explained_share=explained_share,
        # Both are of interest only where fields deviate, and take a fit of every field.
        own_mean_share=own_mean_share(evidences) if deviating else 0.0,
        chance_of_largest_mean=chance_of_largest(means_px, errors_px) if deviating else 1.0,
    )
    return (residual, *templates)


def mean_statistics(
    stream: str,
    fields: Sequence[FieldResidual],
    rate: RateFit | None,
    facts: Facts,
    features: tuple[Feature, ...],
) -> list[Statistic]:
    """Return the statistics of all fields of a rate: mean residual flow, gain and geometric templates.

    Parameters
    ----------
    stream
        ``flow/<rate>hz``.
    fields
        Measured fields of the rate, in the order of time.
    rate
        Fit of all fields; None where too few tiles match.
    features
        Of the residual flow of the rate.

    Returns
    -------
    list[Statistic]
        Empty without a fit.
    """
    if rate is None:
        return []
    where = place(facts, (fields[0].interval, fields[-1].interval))

    def statistic(name: str, estimate: TemplateSizes, index: int, unit: str, rule: str, statement: str) -> Statistic:
        return Statistic(
            name=f"{stream} {name}",
            value=float(estimate.sizes[index]),
            unit=unit,
            standard_error=float(estimate.errors[index]),
            model_error_bound=float(estimate.biases[index]),
            effect_px=float(estimate.effects_px[index]),
            statement=statement,
            code=f"flow_photometric.residual.{rule}",
            where=where,
            features=features,
        )

    mean_px, percent = rate.mean.sizes, 100 * float(rate.gain.sizes[0])
    statistics = [
        statistic(f"residual_{axis}", rate.mean, i, "px", "mean",
                  f"{stream} displaces frames by {abs(mean_px[i]):.3g} px too far "
                  f"{('right', 'down')[i] if mean_px[i] > 0 else ('left', 'up')[i]} on average.")
        for i, axis in enumerate("uv")
    ]  # fmt: skip
    statistics.append(
        statistic("gain", rate.gain.scaled(100), 0, "percent", "gain",
                  f"{stream} is {abs(percent):.3g}% too {'large' if percent > 0 else 'small'} for the frames.")
    )  # fmt: skip
    if rate.geometric is not None:
        statistics += [
            statistic(name, rate.geometric, i, unit, "template",
                      f"{stream} deviates from the frames as if {meaning} by {rate.geometric.sizes[i]:.3g} {unit}.")
            for i, (name, unit, meaning) in enumerate(_GEOMETRIC) if np.isfinite(rate.geometric.errors[i])
            and rate.geometric.errors[i] < _UNDETERMINED
        ]  # fmt: skip
    return statistics


def worst_statistics(
    stream: str, fields: Sequence[FieldResidual], facts: Facts, features: tuple[Feature, ...]
) -> list[Statistic]:
    """Return the statistics of the worst of a rate: unmatched tiles, least matched tile, worst field, worst tile.

    Parameters
    ----------
    stream
        ``flow/<rate>hz``.
    fields
        Measured fields of the rate, in the order of time.
    features
        Of the residual flow of the rate.
    """

    def where(field: FieldResidual, tile: tuple[int, int, int, int] | None = None) -> Where:
        return place(facts, (field.interval, field.interval), frame=field.frame, tile=tile)

    def unmatched_share(field: FieldResidual) -> float:
        return field.unmatched_share if field.textured >= _MANY_TILES else 0.0

    # Fields of few tiles are counted only together.
    worst = max(fields, key=unmatched_share)
    of_all_fields = sum(field.unmatched for field in fields) / sum(field.textured for field in fields)
    share = max(unmatched_share(worst), of_all_fields)
    deviating = [field for field in fields if field.unmatched_share > UNMATCHED_SHARE]
    statistics = [
        Statistic(
            name=f"{stream} unmatched_tiles",
            value=100 * share,
            unit="percent",
            standard_error=0.0,
            model_error_bound=100 * UNMATCHED_SHARE,
            side="upper",
            statement=f"In {len(deviating)} of {len(fields)} fields of {stream} the flow contradicts the frames: up to "
            f"{100 * share:.0f}% of a field's tiles do not match.",
            code="flow_photometric.residual.unmatched",
            where=place(facts, (deviating[0].interval, deviating[-1].interval), frame=worst.frame)
            if deviating
            else Where(stream=stream),
            features=features,
        )
    ]
    # The worst tile in px is one of those that match: the least matched tile is a separate statistic.
    masked_by_depth = [field for field in fields if field.least_matched_tile is not None]
    if masked_by_depth:
        worst = max(masked_by_depth, key=lambda field: field.least_matched)
        statistics.append(
            Statistic(
                name=f"{stream} least_matched_tile",
                value=100 * worst.least_matched,
                unit="percent",
                standard_error=0.0,
                model_error_bound=100 * UNMATCHED,
                side="upper",
                statement=f"In field {worst.interval.row} of {stream} the flow contradicts the frames in one tile: "
                f"{100 * worst.least_matched:.0f}% of its contrast is not explained.",
                code="flow_photometric.residual.tile_match",
                where=where(worst, worst.least_matched_tile),
                features=features,
            )
        )
    fitted = [field for field in fields if field.worst_tile is not None]
    if not fitted:
        return statistics
    # Formal errors times the scatter of the rate's tiles (Birge 1932).
    errors_px = [scale * max(field.mean_error_px) for field, scale in zip(fitted, scales_of(fitted), strict=True)]
    worst, error_px = max(
        zip(fitted, errors_px, strict=True), key=lambda pair: _mean_px(pair[0]) / (_field_bias_px(pair[0]) + pair[1])
    )
    statistics.append(
        Statistic(
            name=f"{stream} worst_field",
            value=_mean_px(worst),
            unit="px",
            standard_error=error_px,
            model_error_bound=_field_bias_px(worst),
            side="upper",
            tests=len(fitted),
            sensitivity=sensitivity_range(errors_px, [_field_bias_px(field) for field in fitted]),
            statement=f"Field {worst.interval.row} of {stream} warps frame {worst.frame} with a mean error of "
            f"{_mean_px(worst):.3g} px to the frame at its end.",
            code="flow_photometric.residual.field",
            where=where(worst),
            features=features,
        )
    )
    worst = max(fitted, key=lambda field: (field.worst_px - _TILE_BIAS_PX) / field.worst_error_px)
    statistics.append(
        Statistic(
            name=f"{stream} worst_tile",
            value=worst.worst_px,
            unit="px",
            standard_error=worst.worst_error_px,
            model_error_bound=_TILE_BIAS_PX,
            side="upper",
            # Each textured tile might have been the worst.
            tests=sum(field.textured for field in fitted),
            sensitivity=sensitivity_range([field.tile_errors_px for field in fitted], _TILE_BIAS_PX),
            statement=f"Field {worst.interval.row} of {stream} has an error of {worst.worst_px:.3g} px in one tile.",
            code="flow_photometric.residual.tile",
            where=where(worst, worst.worst_tile),
            features=features,
        )
    )
    return statistics


def _field_bias_px(field: FieldResidual) -> float:
    # The error of peak locking is proportional to sin(2 pi flow); its mean over the field's tiles counts (class
    # docstring of the check).
    return _FIELD_BIAS_PX * field.mean_locking


def _mean_px(field: FieldResidual) -> float:
    return float(np.hypot(*field.mean_px))
