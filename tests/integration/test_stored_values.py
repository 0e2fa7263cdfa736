"""Correct files whose numbers were rounded as publishers round them are clean."""

from pathlib import Path

import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.support.sequences import CleanSequence
from tests.support.stored_values import ROUNDINGS, store_rounded

CHECKS = {
    "depth": ("depth", "alignment.depth", "flow_geometry"),
    "flow": ("flow_geometry", "flow_rates", "flow_photometric"),
    "quaternions": ("pose", "imu", "flow_geometry"),
    "positions": ("pose", "imu", "flow_geometry"),
    "imu": ("imu",),
}
"""Checks that look at the rounded datasets, by the first word of the rounding."""

EXPECTED_STEPS = {
    "depth to 1 mm": ("storage.depth", "1 mm"),
    "flow to 1/64 px": ("storage.flow.10hz", "0.015625 px"),
    "flow to three decimals": ("storage.flow.50hz", "0.001 px"),
    "flow through float16": ("storage.flow.25hz", "float16"),
    "quaternions to nine decimals": ("storage.pose.orientation", "1e-09"),
    "imu at 16 bits": ("storage.imu.angular_velocity", "0.00106526 rad/s"),
}


@pytest.mark.parametrize("scene", ["park-day", "park-noisy", "fast-turn"])
@pytest.mark.parametrize("rounding", list(ROUNDINGS))
def test_a_rounded_file_passes(rounding: str, scene: str, clean_sequence: CleanSequence, tmp_path: Path) -> None:
    """No check fails that passes before, and the record states the step."""
    path = store_rounded(clean_sequence(scene), tmp_path / "rounded.h5", rounding)
    record = check_file(path, CheckOptions(select=CHECKS[rounding.split(maxsplit=1)[0]], evidence=None)).record
    alarms = [(result.check, [finding.message for finding in result.findings]) for result in record.results
              if result.outcome in {"failed", "crashed"}]  # fmt: skip
    assert alarms == []
    if scene == "park-day" and rounding in EXPECTED_STEPS:
        key, step = EXPECTED_STEPS[rounding]
        assert record.inferred[key] == step
