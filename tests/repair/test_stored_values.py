"""Canonical values return to stored ones: whatever is read is stored again as it was, or refused."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from fedora_qa.errors import NotRepairableError
from fedora_qa.layout.binding import Binding, canonical_values, selected_columns
from fedora_qa.repairs.write import replace_values


def bound(key: str, stored: NDArray[Any], **conversion: Any) -> Binding:
    """A binding of stored rows."""
    return Binding(key, key, len(stored), stored.shape, stored.dtype, **conversion)


def read(stored: NDArray[Any], binding: Binding, origin_ns: int = 0) -> NDArray[Any]:
    """Canonical values of stored rows."""
    return canonical_values(selected_columns(stored, binding), binding, origin_ns)


EPOCH_S = 1_504_645_177
UNITS = st.sampled_from([(1, "i8"), (1000, "i8"), (1000, "u4"), (1_000_000, "i8"), (1000, "f8"), (10**9, "f8")])


@given(UNITS, st.lists(st.integers(0, 4_000_000), min_size=2, max_size=20), st.booleans(), st.integers(0, 10**9))
def test_reversed_timestamps_keep_their_bits(
    unit: tuple[int, str], numbers: list[int], from_epoch: bool, apart_ns: int
) -> None:
    """In every unit and type, from an origin of another stream, after 1970 or from zero."""
    ns_per_unit, dtype = unit
    numbers_in_us = (
        np.array(numbers, np.int64) * 1000 // ns_per_unit if dtype != "f8" else np.array(numbers) / (ns_per_unit / 1000)
    )
    epoch = EPOCH_S * 10**9 // ns_per_unit if from_epoch and dtype != "u4" else 0
    stored = (numbers_in_us + epoch).astype(dtype)
    binding = bound("path/imu/ts", stored, ns_per_unit=ns_per_unit)
    origin_ns = epoch * ns_per_unit + apart_ns
    reversed_rows = stored.copy()
    replace_values(reversed_rows, binding, read(stored, binding, origin_ns)[::-1], origin_ns)
    np.testing.assert_array_equal(reversed_rows, stored[::-1])


@given(
    arrays(np.float32, (4, 3), elements=st.floats(0.125, 65536, width=32) | st.just(np.nan)),
    st.sampled_from([1.0, 1000.0, 10.0]),
    st.sampled_from(["f4", "f8"]),
)
def test_values_that_stay_keep_their_bits_and_others_their_digits(
    values: NDArray[Any], scale: float, dtype: str
) -> None:
    """Depth in millimetres, centimetres and metres: the first half of the rows is doubled."""
    stored = values.astype(dtype)[..., np.newaxis]
    binding = bound("path/depth", stored, scale=scale)
    wanted = read(stored, binding).copy()
    wanted[:2] *= 2
    altered = stored.copy()
    replace_values(altered, binding, wanted, 0)
    np.testing.assert_array_equal(altered[2:].view(np.uint8), stored[2:].view(np.uint8))
    np.testing.assert_allclose(altered[:2], 2 * stored[:2].astype(np.float64), rtol=2.0**-22)


@pytest.mark.parametrize(
    ("polarity", "dtype", "codes"),
    [("01", "u1", (1, 0)), ("01", "?", (1, 0)), ("inverted", "u2", (0, 1)), ("plus_minus", "i1", (1, -1)),
     ("plus_minus", "f8", (1, -1))],
)  # fmt: skip
def test_polarity_in_each_code(polarity: Any, dtype: str, codes: tuple[int, int]) -> None:
    """Brighter and darker are exchanged in the code of the dialect."""
    stored = np.array([codes[0], codes[1], codes[1]], dtype)
    binding = bound("path/events/p", stored, polarity=polarity)
    replace_values(stored, binding, np.array([0, 1, 1], np.uint8), 0)
    np.testing.assert_array_equal(stored, np.array([codes[1], codes[0], codes[0]], dtype))


def test_columns_of_a_table_and_of_quaternions() -> None:
    """Each canonical column returns to its place; others stay."""
    table = np.array([[1.0, 2.0, 3.0, 1.0], [4.0, 5.0, 6.0, 0.0]])
    replace_values(table, bound("path/events/y", table, columns=(1,)), np.array([7, 8], np.uint16), 0)
    np.testing.assert_array_equal(table, [[1, 7, 3, 1], [4, 8, 6, 0]])
    wxyz = np.array([[1.0, 0.0, 0.0, 0.0]])
    binding = bound("path/pose/orientation", wxyz, columns=(1, 2, 3, 0))
    replace_values(wxyz, binding, np.array([[0.5, 0.1, 0.2, 0.9]]), 0)
    np.testing.assert_array_equal(wxyz, [[0.9, 0.5, 0.1, 0.2]])


def test_one_offset_moves_all_timestamps_by_one_number_of_units() -> None:
    """Half a unit too: timestamps keep their distances."""
    stored = np.arange(0, 60, 3)
    binding = bound("path/imu/ts", stored, ns_per_unit=1000)
    replace_values(stored, binding, read(stored, binding) - 2500, 0)
    assert set(np.diff(stored)) == {3}


GREY = np.full((2, 3, 4), 9, np.uint8)
REFUSED: list[tuple[str, Binding, NDArray[Any], NDArray[Any], str]] = [
    ("NaN in whole millimetres", bound("path/depth", np.full((1, 2, 2), 7, np.uint16)),
     np.full((1, 2, 2), 7, np.uint16), np.full((1, 2, 2), np.nan, np.float32), "uint16 for NaN or infinity"),
    ("beyond the type", bound("path/events/t", np.arange(3, dtype=np.uint32), ns_per_unit=1000),
     np.arange(3, dtype=np.uint32), np.array([-1000, 0, 1000]), "uint32 for numbers from -1"),
    ("beyond half precision", bound("path/depth", np.ones((1, 2, 2), np.float16)), np.ones((1, 2, 2), np.float16),
     np.full((1, 2, 2), 1e5, np.float32), "float16 for more rounding"),
    ("fractions of a millisecond", bound("path/imu/ts", np.arange(3), ns_per_unit=1_000_000), np.arange(3),
     np.array([0, 1_003_000, 2_000_000]), "int64 for more rounding"),
    ("single-precision seconds", bound("path/imu/ts", np.full(1, 1000.0, np.float32), ns_per_unit=10**9),
     np.full(1, 1000.0, np.float32), np.array([1_000_000_013_000]), "float32 for more rounding"),
    ("colour in a grey image", bound("path/rgb", GREY, columns=(0, 0, 0)), GREY,
     np.broadcast_to(np.array([1, 2, 3], np.uint8), (2, 3, 4, 3)), "columns that share one stored value"),
    ("an unknown polarity", bound("path/events/p", np.array([1, 7], np.uint8)), np.array([1, 7], np.uint8),
     np.array([255, 1], np.uint8), "polarities that the dialect does not define"),
]  # fmt: skip


@pytest.mark.parametrize(("binding", "stored", "wanted", "reason"), [row[1:] for row in REFUSED],
                         ids=[row[0] for row in REFUSED])  # fmt: skip
def test_what_the_stored_type_cannot_hold_is_refused(
    binding: Binding, stored: NDArray[Any], wanted: NDArray[Any], reason: str
) -> None:
    """The message names the type and the reason."""
    with pytest.raises(NotRepairableError, match=reason):
        replace_values(stored.copy(), binding, wanted, 0)


def test_one_channel_of_images_is_replaced() -> None:
    """Depth that is one channel of several is written there; the others stay."""
    stored = np.zeros((2, 1, 2, 4), np.uint16)
    replace_values(stored, bound("path/depth", stored, columns=(3,)), np.full((2, 1, 2), 7, np.float32), 0)
    assert stored.tolist() == [[[[0, 0, 0, 7]] * 2]] * 2
