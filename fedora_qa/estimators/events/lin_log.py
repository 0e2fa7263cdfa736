"""The response of an event sensor that is linear in the dark and logarithmic in light."""

from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray


def logarithmic_light(light_dn: NDArray[Any], linear_below_dn: float) -> NDArray[np.float64]:
    """Return the light whose logarithm is the lin-log response to light.

    L = Y ln(T) / T below T, and ln Y above: continuous, with L = 0 in the dark. So exp L, in place of Y, takes a
    lin-log sensor to a logarithmic one.

    Parameters
    ----------
    light_dn
        Y of any shape, linear DN, at least 0.
    linear_below_dn
        T, DN, above 1.

    Returns
    -------
    ndarray of float64
        exp L, DN: T^(Y/T) below T, and Y from T on.

    References
    ----------
    Hu, Liu and Delbruck 2021, "v2e: From Video Frames to Realistic DVS Events" (linear to logarithmic mapping).
    """
    light = np.asarray(light_dn, np.float64)
    slope = log(linear_below_dn) / linear_below_dn
    return np.where(light < linear_below_dn, np.exp(slope * np.minimum(light, linear_below_dn)), light)


def logarithmic_light_error(
    light_dn: NDArray[Any], error_dn: NDArray[Any], linear_below_dn: float
) -> NDArray[np.float64]:
    """Return the bound of the error of ``logarithmic_light`` that follows from that of light.

    The function rises and is convex but at T, where its slope falls from ln T to 1: the change is largest to one of
    both sides of the interval.

    Parameters
    ----------
    light_dn, error_dn
        Y and the bound of its error, of one shape, DN; infinite bounds stay infinite.
    linear_below_dn
        T, DN, above 1.

    Returns
    -------
    ndarray of float64
        Of the shape of both, DN.
    """
    middle = logarithmic_light(light_dn, linear_below_dn)
    above = logarithmic_light(light_dn + error_dn, linear_below_dn)
    below = logarithmic_light(np.maximum(light_dn - error_dn, 0.0), linear_below_dn)
    return np.maximum(above - middle, middle - below)
