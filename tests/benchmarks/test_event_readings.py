"""The page of bounded readings holds each row to the bounds as they are set."""

from tests.benchmarks.event_readings import BOUNDS, Measurement, page


def test_each_bound_is_tried_as_it_is_set() -> None:
    """Else there is nothing to hold the others to."""
    assert all(bound.chosen in bound.tried for bound in BOUNDS)


def test_times_are_ratios_to_the_bounds_as_set() -> None:
    """Half the time reads as 0.50, a limit that was not stated as a dash."""
    measurements = {
        (bound.name, value): Measurement(2.0 if value == bound.chosen else 1.0, (0.1, None, 3.0))
        for bound in BOUNDS
        for value in bound.tried
    }
    rows = [line for line in page(measurements, 1000.0) if line.startswith("| ") and "---" not in line]
    assert len(rows) == sum(len(bound.tried) for bound in BOUNDS)
    assert rows[0] == "| events used for timing, a window | 3750 | 0.50 | 0.1 | - | 3 |\n"
    assert rows[4] == "| events used for timing, a window | **60000** | 1.00 | 0.1 | - | 3 |\n"
