"""How the fitted parameters of IMU against pose are stated: words, units, and what matters of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fedora_qa.checks.imu.imu_suspects import suspects_for
from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.fitting.grouped_fit import Fitted, group_of
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.inertial_agreement import Kind, Streams
from fedora_qa.views.motion_samples import place
from fedora_qa.views.timing_cues import TimingCues

_DEGREES: Final = float(np.degrees(1.0))


@dataclass(frozen=True, slots=True)
class Shown:
    """How a parameter is shown.

    Attributes
    ----------
    says
        The sentence, with ``{size}``, ``{axis}`` and ``{sense}``.
    senses
        What a positive and a negative value are called.
    unit, factor
        The unit shown, and its multiple of the fit's unit.
    matters
        The largest deviation that may go unseen, in the unit shown.
    """

    says: str
    senses: tuple[str, str]
    unit: str
    factor: float
    material: float


_SIGNS: Final = ("", "-")

ROTATION_SHOWN: Final[Mapping[str, Shown]] = {
    "bias": Shown("The gyro has a bias of {sense}{size} rad/s about {axis}", _SIGNS, "rad/s", 1.0, 0.02),
    "tilt": Shown("The gyro is turned by {sense}{size} deg about {axis} against the body of the poses", _SIGNS, "deg",
                  _DEGREES, 1.0),
    "scale": Shown("The gyro reads {size} percent too {sense}", ("much", "little"), "percent", 100.0, 2.0),
}  # fmt: skip

TRANSLATION_SHOWN: Final[Mapping[str, Shown]] = {
    "gravity": Shown("Gravity is {size} m/s^2 {sense} than declared", ("larger", "smaller"), "m/s^2", 1.0, 0.2),
    "bias": Shown("The accelerometer has a bias of {sense}{size} m/s^2 along {axis}", _SIGNS, "m/s^2", 1.0, 0.2),
    "slope": Shown("Gravity has a part of {sense}{size} m/s^2 along the world's {axis}", _SIGNS, "m/s^2", 1.0, 0.2),
    "lever": Shown("The IMU sits at {sense}{size} m along {axis} from the poses' origin", _SIGNS, "m", 1.0, 0.1),
}

TIMING_SHOWN: Final[Mapping[str, Shown]] = {
    "time_offset": Shown(
        "The IMU's stamps are {size} ms {sense} against the poses'", ("late", "early"), "ms", 1e3, 1.0
    ),
    "clock_rate": Shown("The IMU's clock runs {size} ppm {sense}", ("fast", "slow"), "ppm", 1e6, 500.0),
    "pose_clock_rate": Shown("The poses' clock runs {size} ppm {sense}", ("fast", "slow"), "ppm", 1e6, 500.0),
}


def parameters_measured(
    kind: Kind,
    check: str,
    found: Mapping[str, Fitted],
    shown: Mapping[str, Shown],
    timing_cues: TimingCues,
    besides: tuple[Suspect, ...] = (),
) -> tuple[Statistic, ...]:
    """State the fitted parameters that are to be shown; ``besides`` are causes that are known to disturb the fit."""
    chosen = {name: one for name, one in found.items() if group_of(name) in shown}
    sizes: dict[str, float] = {}
    for name, one in chosen.items():
        sizes[group_of(name)] = max(abs(one.value), sizes.get(group_of(name), 0.0))
    measured = []
    for name, one in chosen.items():
        share = abs(one.value) / (sizes[group_of(name)] or 1.0)
        suspects = (*besides, *suspects_for(kind, name, one, share, timing_cues))
        measured.append(_measured(check, name, one, shown[group_of(name)], suspects))
    return tuple(measured)


def local_measured(
    facts: Facts,
    streams: Streams,
    kind: Kind,
    check: str,
    fit: InertialFit,
    group: str,
    shown: Shown,
    timing_cues: TimingCues,
    besides: tuple[Suspect, ...] = (),
) -> tuple[Statistic, ...]:
    """State where a parameter of the group differs most from its value in the whole; nothing of very few stretches."""
    names = [name for name in fit.uneven if group_of(name) == group]
    if not names or not fit.settled:
        return ()
    name = max(names, key=lambda each: abs(fit.uneven[each].deviation) / fit.uneven[each].standard_error)
    found = fit.uneven[name]
    where = place(facts, "imu", streams.time_ns(found.start_s), streams.time_ns(found.stop_s))
    there = replace(fit.parameters[name], value=found.value, standard_error=found.standard_error)
    size = f"{shown.factor * found.value:.4g} {shown.unit}"
    return (
        Statistic(
            name=f"local_{group}",
            value=shown.factor * found.deviation,
            unit=shown.unit,
            standard_error=shown.factor * found.standard_error,
            model_error_bound=shown.factor * found.model_error,
            material=shown.material,
            tests=found.tests * len(names),
            statement=f"From {where.start_us:.0f} to {where.stop_us:.0f} us {name} is {size}, "
            f"{shown.factor * found.deviation:+.4g} off its value in the whole sequence.",
            code=f"{check}.local_{group}",
            where=where,
            suspects=(*besides, *suspects_for(kind, name, there, 1.0, timing_cues)),
        ),
    )


def _measured(check: str, name: str, found: Fitted, shown: Shown, suspects: tuple[Suspect, ...]) -> Statistic:
    value, error = shown.factor * found.value, shown.factor * found.standard_error
    sentence = shown.says.format(size=f"{abs(value):.4g}", axis=name[-1], sense=shown.senses[int(value < 0)])
    return Statistic(
        name=name,
        value=value,
        unit=shown.unit,
        standard_error=error,
        model_error_bound=shown.factor * found.model_error,
        material=shown.material,
        statement=f"{sentence} (+- {error:.2g}).",
        code=f"{check}.{group_of(name)}",
        where=Where(stream="imu"),
        suspects=suspects,
    )
