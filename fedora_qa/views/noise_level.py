"""Measured noise against its declaration, for any sampled stream."""

from collections.abc import Mapping
from typing import Final

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.imu.local_motion import NoiseLevel
from fedora_qa.record.types import Where

_SAME_FACTOR: Final = 0.2
"""Noise is measured to some percent: a ratio this close to a unit's factor is that unit."""

_OTHER: Final = 0.6
"""A stream of another sequence has its noise too: less likely than a wrong declaration, unless other checks agree."""


def noise_against_declared(
    name: str,
    unit: str,
    level: NoiseLevel,
    declared: float,
    floor: float,
    check: str,
    stream: str,
    *,
    units: Mapping[str, float],
    besides: tuple[Suspect, ...] = (),
) -> Statistic:
    """State the ratio of measured to declared noise, or the noise itself where none is declared.

    ``units`` are causes that would multiply all values by a factor: noise that is too large by just that is none.
    ``besides`` are defects of the samples that are known to look like noise.
    """
    if declared > 0:
        ratio = level.sigma / declared
        error = 100.0 * (1.0 / ratio - 1.0) if ratio > 0 else None
        return Statistic(
            name=f"{name}_noise_ratio",
            value=ratio,
            unit="1",
            standard_error=level.standard_error / level.sigma if level.sigma > 0 else 0.0,
            expected=1.0,
            model_error_bound=(level.motion + floor) / declared,
            material=0.5,
            statement=f"{name.capitalize()} noise is {level.sigma:.3g} {unit}; {declared:.3g} {unit} is declared.",
            code=f"{check}.{name}",
            where=Where(stream=stream),
            suspects=(
                *besides,
                *_mistaken_units(stream, ratio, units),
                Suspect("noise_misdeclared", stream, 0.5 if besides else 0.9, error, "percent",
                        100.0 * level.standard_error / level.sigma / ratio if ratio > 0 else None),
                Suspect("other_sequence", stream, _OTHER),
            ),
        )  # fmt: skip
    return Statistic(
        name=f"{name}_noise",
        value=level.sigma,
        unit=unit,
        standard_error=level.standard_error,
        model_error_bound=level.motion + floor,
        side="upper",
        statement=f"{name.capitalize()} has noise of {level.sigma:.3g} {unit}; none is declared.",
        code=f"{check}.{name}",
        where=Where(stream=stream),
        suspects=(
            *besides,
            Suspect("noise_misdeclared", stream, 0.5 if besides else 0.9, -100.0, "percent"),
            Suspect("other_sequence", stream, _OTHER),
        ),
    )


def _mistaken_units(stream: str, ratio: float, units: Mapping[str, float]) -> tuple[Suspect, ...]:
    return tuple(
        Suspect(cause, stream, 0.95, factor, "1")
        for cause, factor in units.items()
        if abs(ratio / factor - 1.0) < _SAME_FACTOR
    )
