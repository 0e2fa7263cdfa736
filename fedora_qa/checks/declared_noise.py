"""White noise of a sampled stream against its declaration."""

from collections.abc import Mapping
from dataclasses import dataclass

from fedora_qa.checks.protocol import Notice, Statistic
from fedora_qa.estimators.imu.white_noise import NoiseLevel
from fedora_qa.features import Feature
from fedora_qa.record.types import Where


@dataclass(frozen=True, slots=True)
class MeasuredNoise(Feature):
    """Measured and declared white noise of a stream, in one unit.

    Attributes
    ----------
    sigma, standard_error
        Standard deviation of the noise, and its standard error.
    declared
        Declared standard deviation; 0 for none.
    """

    sigma: float
    standard_error: float
    declared: float


def noise_against_declared(
    name: str,
    unit: str,
    level: NoiseLevel,
    declared: float,
    floor: float,
    *,
    check: str,
    stream: str,
    features: tuple[Feature, ...] = (),
) -> Statistic:
    """Return the ratio of measured to declared noise, or the noise itself where none is declared.

    Parameters
    ----------
    name, unit
        Name of the quantity, and its unit.
    level
        The measured noise, in ``unit``.
    declared
        Standard deviation that the file declares, in ``unit``; 0 where it declares none.
    floor
        Scatter of exact samples by rounded timestamps and stored digits, in ``unit``.
    stream
        Stream of the samples.
    features
        Defects of the samples that have the effect of noise.

    Returns
    -------
    Statistic
        With 1 expected for a ratio, and 0 for a noise in ``unit``.
    """
    features = (*features, MeasuredNoise(level.sigma, level.standard_error, declared))
    # A declared sigma is compared as a ratio; with sigma 0 only rounding and motion are allowed.
    if declared > 0:
        return Statistic(
            name=f"{name}_noise_ratio",
            value=level.sigma / declared,
            unit="1",
            standard_error=level.standard_error / level.sigma if level.sigma > 0 else 0.0,
            expected=1.0,
            # Motion and rounding are bounds: they add to each other, not in squares.
            model_error_bound=(level.motion + floor) / declared,
            statement=f"{name.capitalize()} noise is {level.sigma:.3g} {unit}; {declared:.3g} {unit} is declared.",
            code=f"{check}.{name}",
            where=Where(stream=stream),
            features=features,
        )
    return Statistic(
        name=f"{name}_noise",
        value=level.sigma,
        unit=unit,
        standard_error=level.standard_error,
        model_error_bound=level.motion + floor,
        # Only noise beyond rounding and motion contradicts a declaration of no noise.
        side="upper",
        statement=f"{name.capitalize()} has noise of {level.sigma:.3g} {unit}; none is declared.",
        code=f"{check}.{name}",
        where=Where(stream=stream),
        features=features,
    )


def undeclared_noise(
    check: str, stream: str, levels: Mapping[str, tuple[NoiseLevel, str]]
) -> tuple[Notice, dict[str, str | float]]:
    """State the noise of a stream without declared noise; it is not judged.

    Real sensors and trajectories have noise, and a dataset that declares none makes no claim about it.

    Parameters
    ----------
    stream
        Stream of the samples.
    levels
        Measured noise and its unit, by the name of the quantity.

    Returns
    -------
    tuple
        A notice with the noise of each quantity, and the same as facts for the record: ``pose.position_noise_m``. The
        contributions of motion, rounding and stored digits are included.
    """
    sizes = ", ".join(f"{level.sigma:.3g} {unit} of {name}" for name, (level, unit) in levels.items())
    notice = Notice(
        f"{check}.undeclared",
        f"The noise of the {stream} is not declared, and is not judged: {sizes}.",
        Where(stream=stream),
    )
    return notice, {
        f"{stream}.{name}_noise_{unit.replace('/', '_').replace('^', '')}": level.sigma
        for name, (level, unit) in levels.items()
    }
