"""What the codes of frames state about the transfer curve, as a feature."""

from dataclasses import dataclass

from fedora_qa.features import Feature


@dataclass(frozen=True, slots=True)
class CodesBent(Feature):
    """Codes are absent as under a power law that was applied to rounded values.

    Attributes
    ----------
    exponent
        Of the power law.
    """

    exponent: float
