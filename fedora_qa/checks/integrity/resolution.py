"""The steps in which values are stored, and the error that rounding to them causes in derived quantities."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.flow_rate_deviations import with_flow_rate_deviations
from fedora_qa.checks.material_rounding import MATERIAL, UNIFORM
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic
from fedora_qa.conventions import MM_PER_M, NS_PER_S
from fedora_qa.estimators.imu.samples import mean_rounding_bound
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import datasets_of_all, spec_of
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.stored_step import StoredStep

_LARGE_FLOW_PX: Final = 20.0
"""A large mean flow, px: the error of a mantissa is stated there."""


@dataclass(frozen=True, slots=True)
class CoarseStep(Feature):
    """The step of a dataset.

    Attributes
    ----------
    text
        The step in words.
    size
        The coarsest step of a component, in its unit; 0 for a step that grows with the value.
    """

    text: str
    size: float = 0.0


class IntegrityResolution(FactsCheck):
    """Are values stored with a fine enough step for the quantities that are derived from them?

    For each dataset of depth, flow, poses and IMU that is stored in steps: the error that rounding to the step alone
    causes in a derived quantity, as a multiple of the size from which such an error is material.

    Why it matters
    --------------
    All other checks count the stored step as noise, so that correct rounding is no fault. Values that were rounded to a
    quarter of a pixel or to a decimetre could therefore pass every other check, and are useless as ground truth.

    How
    ---
    The step of each component is inferred from its values (``fedora_qa/estimators/storage/steps.py``): decimal, binary,
    that of a mantissa, or the full scale of a sensor divided by its number of codes. The error is, for flow, the
    endpoint error ``sqrt((su^2 + sv^2) / 12)`` (for float16 at 20 px); for depth, the standard deviation of its
    rounding relative to the median depth, which is also the relative error of a parallax; for positions, the length of
    the error vector; for orientations, twice the length of the quaternion's error, in rad; for the IMU, the bias of a
    sensor at rest, which is half a step, or less where noise is declared (``fedora_qa/estimators/imu/samples.py``).
    Single precision counts where values are so far from 0 that its rounding is material, such as positions in metres
    from the equator.

    Noise model
    -----------
    Rounding to a step s is uniform, with variance ``s^2/12``. The step is exact, or known to 0.1%. The limit is 1,
    because the error is stated as a multiple of its material size.

    Cannot detect
    -------------
    Steps of a part of the stream. Steps of which too few occur, as for a body at rest. Steps of colour and of
    timestamps (``clocks.resolution``).

    Sources
    -------
    B. Widrow, I. Kollar, Quantization Noise, Cambridge 2008; ``fedora_qa/judgement/materiality.toml`` for the sizes.
    """

    name = "integrity.resolution"
    looks_at = ("depth", "flow", "pose", "imu")

    def not_applicable(self, facts: Facts) -> str:
        """Require depth, flow, poses or IMU."""
        present = any(_material_key(spec.key) for spec in datasets_of_all(facts.streams))
        return "" if present else "the file has neither depth nor flow nor poses nor an IMU"

    def examine(self, facts: Facts) -> Observation:
        """Compare the error by each step with its material size."""
        statistics = []
        keys = [spec.key for spec in datasets_of_all(facts.streams) if _material_key(spec.key)]
        for key in keys:
            step = facts.steps.get(key)
            if step is None or not step.is_identifiable:
                continue
            size, unit, _ = MATERIAL[_material_key(key)]
            error = _derived_error(key, step, facts)
            # Single precision is no step, unless the values are so far from 0 that its rounding is material.
            error = error if step.is_coarse or error > size else 0.0
            text = step.text(spec_of(key).units)
            statistics.append(
                Statistic(
                    name=f"{key}.step",
                    value=error / size,
                    unit="1",
                    standard_error=0.0,
                    model_error_bound=1.0,
                    side="upper",
                    statement=f"{key} is stored in steps of {text}: rounding alone causes an error of "
                    f"{error:.2g} {unit}, and {size:g} {unit} is material.",
                    code="integrity.resolution.step",
                    where=Where(stream=spec_of(key).stream),
                    features=(CoarseStep(text, max(part.size for part in step.components or (step,))),),
                )
            )
        coverage = Coverage(len(statistics), len(keys), "datasets")
        if not statistics:
            return Observation(
                coverage,
                unobservable="values of depth, flow, poses and IMU cannot be read, or differ too little for a step",
            )
        return Observation(coverage, with_flow_rate_deviations(statistics, set(facts.flow_streams)))


def _material_key(key: str) -> str:
    """Return the key of ``MATERIAL`` for a dataset; empty where it has none."""
    spec = spec_of(key)
    if spec.stream.startswith("flow/") and spec.units == "px":
        return "flow"
    return key if key in MATERIAL else ""


def _derived_error(key: str, step: StoredStep, facts: Facts) -> float:
    """Return the error that rounding causes in the quantity derived from a dataset, in the unit of ``MATERIAL``."""
    spec = spec_of(key)
    count = spec.shape[-1]
    # The last axis of depth is that of its columns.
    components = [step.component(i) for i in range(count if isinstance(count, int) else 1)]
    if spec.stream == "imu":
        model = facts.declared.imu or ImuModel()
        gyro = key.endswith("angular_velocity")
        times_ns = facts.clocks["imu"].times_ns
        sample_s = float(np.median(np.diff(times_ns))) / NS_PER_S if len(times_ns) > 1 else 1.0
        noise = (model.gyro_noise_density if gyro else model.accel_noise_density) / max(sample_s, 1e-9) ** 0.5
        # A mantissa has the step of its largest error at the typical value.
        steps = [2 * float(component.error_bounds(component.typical)) for component in components]
        return max(mean_rounding_bound(np.zeros(1), size, noise) for size in steps)
    if key == "path/depth":
        typical = step.typical or MM_PER_M
        return float(step.error_bounds(typical)) / UNIFORM / typical
    is_flow = _material_key(key) == "flow"
    bounds = [float(part.error_bounds(_LARGE_FLOW_PX if is_flow else part.typical)) for part in components]
    length = float(np.linalg.norm(bounds)) / UNIFORM
    # A quaternion holds half angles.
    return 2 * length if key.endswith("orientation") else length
