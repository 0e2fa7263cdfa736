"""What a measurement shows of its failure, as typed values that name no cause: a delay, a ratio, a mask.

A check, or a view that it looks at, derives its features from ``Feature``; ``diagnosis/`` reads them.
"""


class Feature:
    """Base of all features; subclasses are frozen dataclasses."""

    __slots__ = ()
