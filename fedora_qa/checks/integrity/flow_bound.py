"""How long can a displacement be? Longer than any number of pixels, but seldom.

A point that comes to lie at depth Z beside the camera is displaced by f R / Z, where R is its distance from the optical
axis; the layout keeps it until Z reaches zero. So no length is impossible, and a bound needs a rate of false alarms.

A surface that meets the plane Z = 0 meets it along a curve, which takes W + H pixels of an image at most, about. From
one pixel to the next across the curve Z changes by some g, and the pixel nearest to the curve has a Z that is uniform
between 0 and g: it is displaced by more than B with probability f R / (g B). A wall along the optical axis, seen r px
from the middle, has Z = f R / r, so g = Z / r and f R / g = r^2; one that leans towards the camera by a slope t has
f R / g = r^2 + r f t. Slopes of surfaces in all directions exceed t with probability 1 / t, so that up to 100, beyond
which the camera flies into what it sees, their mean is ln 100. Over an image of diagonal D, with r^2 = D^2 / 12 and
r = 0.28 D on average and f = 0.69 D (60 degrees of view), that is 0.97 D^2 px; D^2 is taken.
"""

from math import hypot
from typing import Final

FALSE_ALARMS: Final = 1e-6
"""Chance that an honest field anywhere in a file passes the bound: a hundredth of what a file may alarm by default."""


def longest_displacement_px(intervals: int, height: int, width: int) -> float:
    """Return what no displacement of an honest file exceeds, but for one file in a million, in px.

    Parameters
    ----------
    intervals
        Fields of the rate. Each is counted with a curve through the whole image.
    height, width
        Of a field, in px.
    """
    return intervals * (height + width) * hypot(height, width) ** 2 / FALSE_ALARMS
