"""Lin-log light has the lin-log response as its logarithm, and a bound that holds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.estimators.events.lin_log import logarithmic_light, logarithmic_light_error

LIGHT_DN = st.floats(0, 300)
BELOW_DN = st.floats(1.1, 200)


@pytest.mark.parametrize("below_dn", [1.5, 20.0, 80.0])
def test_the_logarithm_is_the_response(below_dn: float) -> None:
    """A straight line from 0 in the dark to ln T at T, and the logarithm from there on."""
    light = np.linspace(0, 255, 511)
    line = np.interp(light, [0, below_dn], [0, np.log(below_dn)])
    expected = np.where(light < below_dn, line, np.log(np.maximum(light, 1)))
    np.testing.assert_allclose(np.log(logarithmic_light(light, below_dn)), expected, atol=1e-12)


@given(light_dn=LIGHT_DN, error_dn=st.floats(0, 50), share=st.floats(-1, 1), below_dn=BELOW_DN)
def test_the_bound_holds(light_dn: float, error_dn: float, share: float, below_dn: float) -> None:
    """Wherever the true light lies within its own bound."""
    light = np.array([light_dn])
    true = np.maximum(light + share * error_dn, 0.0)
    change = np.abs(logarithmic_light(true, below_dn) - logarithmic_light(light, below_dn))
    assert change[0] <= logarithmic_light_error(light, np.array([error_dn]), below_dn)[0] * (1 + 1e-9) + 1e-9


def test_unknown_light_stays_unknown() -> None:
    """A saturated pixel has an infinite bound."""
    assert logarithmic_light_error(np.array([5.0]), np.array([np.inf]), 20.0)[0] == np.inf
