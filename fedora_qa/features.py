"""Features of a failed measurement, as typed values that name no cause: a delay, a ratio, a mask.

Checks and views derive their features from ``Feature``; ``diagnosis/`` reads them.
"""


class Feature:
    """Base of all features; subclasses are frozen dataclasses."""

    __slots__ = ()
