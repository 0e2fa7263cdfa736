"""Factors that are ratios of units of length."""

from fedora_qa.diagnosis.length_units import is_length_unit


def test_units_of_length() -> None:
    """Millimetres, feet and nautical miles; a calibration that is off by some percent is none."""
    assert all(is_length_unit(factor) for factor in (1000.0, 0.001, 0.3048, 1 / 0.3048, 1852.0, 1000.4))
    assert not any(is_length_unit(factor) for factor in (1.0, 1.016, 0.95, 2.0, 500.0))
