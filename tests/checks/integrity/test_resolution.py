"""What rounding does to what is derived, in closed form; the sizes that matter are those of the table."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.checks.integrity.resolution import IntegrityResolution
from fedora_qa.checks.material_rounding import MATERIAL
from fedora_qa.judgement.judge import judge
from fedora_qa.judgement.materiality import Materiality, materiality_row
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.stored_step import DOUBLE_ROUNDOFF, HALF_ROUNDOFF, SINGLE_ROUNDOFF, StoredStep
from tests.support.facts import exact_facts

UNITS = {"flow": "px", "path/depth": "1", "path/imu/angular_velocity": "rad/s", "path/imu/linear_acceleration": "m/s^2"}


def share(key: str, step: StoredStep, facts: Facts | None = None) -> float:
    """The value that the check states of one dataset."""
    observed = IntegrityResolution().examine(replace(facts or exact_facts(), steps={key: step}))
    return observed.measurements[0].value


@pytest.mark.parametrize(
    ("key", "step", "error"),
    [
        ("path/flow/10hz", StoredStep(1 / 64), np.sqrt(2) / 64 / np.sqrt(12)),
        ("path/flow/25hz", StoredStep(0.25, components=(StoredStep(0.25), StoredStep())), 0.25 / np.sqrt(12)),
        ("path/flow/50hz", StoredStep(roundoff=HALF_ROUNDOFF), 20 * HALF_ROUNDOFF * np.sqrt(2 / 3)),
        ("path/depth", StoredStep(100.0, typical=10_000.0), 0.01 / np.sqrt(12)),
        ("path/depth", StoredStep(inverse=1e-6, typical=10_000.0), 0.01 / np.sqrt(12)),
        ("path/pose/position", StoredStep(0.01), 0.01 * np.sqrt(3 / 12)),
        ("path/pose/orientation", StoredStep(1e-3), 2e-3 * np.sqrt(4 / 12)),
        ("path/imu/angular_velocity", StoredStep(0.01), 0.005),
        ("path/imu/linear_acceleration", StoredStep(0.01), 0.005),
    ],
)
def test_each_step_has_the_error_of_uniform_rounding(key: str, step: StoredStep, error: float) -> None:
    """Its standard deviation, of vectors that of their length; of an IMU at rest, half a step."""
    size = MATERIAL["flow" if "flow" in key else key][0]
    assert share(key, step) == pytest.approx(error / size, rel=1e-9)


@pytest.mark.parametrize("roundoff", [SINGLE_ROUNDOFF, DOUBLE_ROUNDOFF])
def test_the_types_of_the_layout_have_no_step(roundoff: float) -> None:
    """Float32 and float64 are no rounding."""
    assert share("path/depth", StoredStep(roundoff=roundoff, typical=1.0)) == 0.0


def test_single_precision_far_away_is_a_step() -> None:
    """Metres from the equator in float32 lie 0.5 m apart; those from the take-off a micrometre."""
    of_utm, of_flight = (StoredStep(roundoff=SINGLE_ROUNDOFF, typical=metres) for metres in (5e6, 10.0))
    assert share("path/pose/position", of_utm) == pytest.approx(5e6 * SINGLE_ROUNDOFF / 1e-3)
    assert share("path/pose/position", of_flight) == 0.0


def test_declared_noise_of_an_imu_averages_its_step() -> None:
    """A sensor with noise of two steps is not biased by them."""
    facts = exact_facts()
    sample_s = float(np.median(np.diff(facts.clocks["imu"].times_ns))) / 1e9
    noisy = ImuModel(gyro_noise_density=0.2 * sample_s**0.5)
    declared = replace(facts, declared=replace(facts.declared, imu=noisy))
    assert share("path/imu/angular_velocity", StoredStep(0.1), declared) < 1e-9
    assert share("path/imu/angular_velocity", StoredStep(0.1), facts) == pytest.approx(50.0)


@pytest.mark.parametrize("profile", ["release", "training", "strict"])
def test_a_coarse_step_fails_and_a_fine_one_passes_under_every_profile(profile: str) -> None:
    """Of a quarter pixel and of 1/64 px."""
    check = IntegrityResolution()
    for size, outcome in ((0.25, "failed"), (1 / 64, "passed")):
        facts = replace(exact_facts(), steps={"path/flow/10hz": StoredStep(size)})
        judged = judge({check.name: check.examine(facts)}, [check], 1e-4, Materiality(profile))  # type: ignore[arg-type]
        assert judged[0].result.outcome == outcome


@pytest.mark.parametrize("key", MATERIAL)
def test_sizes_are_those_of_the_table(key: str) -> None:
    """Of the profile release, in the unit of the row."""
    size, unit, code = MATERIAL[key]
    row = materiality_row(code, UNITS.get(key, unit))
    assert row is not None
    assert row.release == size
