"""The shift that several fields of flow share."""

import numpy as np
import pytest

from fedora_qa.estimators.flow.shift_fit import ShiftFit
from fedora_qa.views.flow_comparison import FieldShift, common_shift

ERROR_PX = 0.01


def field_shift(right_px: float, down_px: float) -> FieldShift:
    """Return a shift that is known to a hundredth of a pixel, along either axis."""
    fit = ShiftFit(np.array([right_px, down_px]), ERROR_PX**2 * np.eye(2), np.zeros(2), 0.99, 0.97, np.zeros(0))
    return FieldShift("flow/10hz", fit)


def test_fields_that_share_a_shift_have_their_mean() -> None:
    """Four fields: the mean of the components, and half the standard error of a field."""
    common = common_shift([field_shift(0.3, -0.4)] * 4)
    assert common is not None
    assert common.value == pytest.approx(-0.5)  # of the sign of the longer component
    assert common.components == pytest.approx((0.3, -0.4))
    assert common.standard_error == pytest.approx(ERROR_PX / 2)
    assert common.removed_share == pytest.approx(0.97)


def test_fields_with_a_shift_each_share_none() -> None:
    """Four shifts by 3 px in four directions: their mean is far below their scatter."""
    assert common_shift([field_shift(*px) for px in ((3.0, 0.0), (-3.0, 0.5), (0.0, 3.0), (0.5, -3.0))]) is None


def test_a_shift_below_its_error_is_none() -> None:
    """One field, shifted by two of its standard errors; and no field at all."""
    assert common_shift([field_shift(2 * ERROR_PX, 0.0)]) is None
    assert common_shift([field_shift(4 * ERROR_PX, 0.0)]) is not None
    assert common_shift([]) is None
