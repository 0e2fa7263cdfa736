"""Samples of IMU, pose and depth range at the ends of float64: found or borne, never a crash, never an overflow."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.layout.binding import LARGEST_SAMPLE, Binding, canonical_rows
from tests.extremes.files import edited, outcomes, record_of
from tests.support.handmade import write_handmade

MOTION = ("path/imu/angular_velocity", "path/imu/linear_acceleration", "path/pose/position", "path/pose/orientation")
EXTENTS = {"one": slice(30, 31), "ten": slice(30, 40), "all": slice(None)}
BEYOND = (1e308, -np.finfo(float).max, np.nextafter(LARGEST_SAMPLE, np.inf))
WITHIN = (LARGEST_SAMPLE, -1e20, 1e12)


@pytest.fixture(scope="module")
def handmade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_handmade(tmp_path_factory.mktemp("samples") / "clean.h5")


def filled(source: Path, target: Path, key: str, extent: slice, value: float) -> Path:
    def fill(file: h5py.File) -> None:
        rows = file[key][()]
        rows.reshape(-1)[extent] = value
        file[key][...] = rows

    return edited(source, target, fill)


def turned(values: tuple[float, ...]) -> list[Any]:
    """Each key with each extent, each of both with each value; the three together once each, not in all ways."""
    return [
        pytest.param(key, rows, values[(k + e) % len(values)], id=f"{key}-{extent}-{values[(k + e) % len(values)]}")
        for k, key in enumerate(MOTION)
        for e, (extent, rows) in enumerate(EXTENTS.items())
    ]


@pytest.mark.parametrize(("key", "extent", "value"), turned(BEYOND))
def test_what_no_unit_can_mean_is_not_finite(
    key: str, extent: slice, value: float, handmade: Path, tmp_path: Path
) -> None:
    """Right: a critical finding of ``integrity.finite``, and no check ends over squares that leave float64."""
    found = outcomes(record_of(filled(handmade, tmp_path / "far.h5", key, extent, value)))
    assert found["integrity.finite"] == "failed"
    assert "crashed" not in found.values()


@pytest.mark.parametrize(("key", "extent", "value"), [*turned(WITHIN[:1]), *turned(WITHIN[1:])])
def test_what_is_merely_absurd_is_measured(
    key: str, extent: slice, value: float, handmade: Path, tmp_path: Path
) -> None:
    """Right: no crash and no overflow (warnings are errors here), and a finding of some check.

    Only a position that is the same everywhere is another origin of the world, and no fault.
    """
    found = outcomes(record_of(filled(handmade, tmp_path / "absurd.h5", key, extent, value)))
    assert "crashed" not in found.values()
    elsewhere = key == "path/pose/position" and extent == slice(None)
    assert ("failed" in found.values()) != elsewhere


@pytest.mark.parametrize("value", [5e-324, 1e-320, np.finfo(float).tiny])
@pytest.mark.parametrize("key", MOTION[:3])
def test_subnormal_samples_are_zeros(key: str, value: float, handmade: Path, tmp_path: Path) -> None:
    """Right: as clean as the zeros of a body at rest, without an underflow that anybody hears of."""
    rows = EXTENTS["one"] if key.endswith("acceleration") else EXTENTS["all"]
    record = record_of(filled(handmade, tmp_path / "tiny.h5", key, rows, value))
    assert "crashed" not in outcomes(record).values()


def test_infinity_begins_just_above_the_largest_sample(tmp_path: Path) -> None:
    """The limit itself is a number, its neighbour above is infinite with its sign, NaN stays NaN."""
    largest = LARGEST_SAMPLE
    above = np.nextafter(largest, np.inf)
    stored = np.array([[largest, above, -above], [-largest, np.nan, 0.0]])
    with h5py.File(tmp_path / "samples.h5", "w") as file:
        file["position"] = stored
        bound = Binding("path/pose/position", "position", 2, (2, 3), np.dtype("f8"))
        read = canonical_rows(file, bound, 0, 2, 0)
        in_mm = canonical_rows(file, Binding(bound.key, "position", 2, (2, 3), bound.dtype, scale=1e-3), 0, 2, 0)
    np.testing.assert_array_equal(read, [[largest, np.inf, -np.inf], [-largest, np.nan, 0.0]])
    assert in_mm[0, 1] == above * 1e-3
