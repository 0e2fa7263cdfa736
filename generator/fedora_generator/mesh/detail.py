"""Options of a mesh world: precision and antialiasing."""

from dataclasses import dataclass
from typing import ClassVar, Final, Literal

from pydantic import ConfigDict

Precision = Literal["float", "8bit"]

GAMMA: Final = 2.2
"""Exponent of the 8-bit encoding, the same as in pyrender's own shader."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshDetail:
    """Precision and antialiasing of a mesh world.

    Attributes
    ----------
    precision
        ``float``: radiance in float32 from the shader to the file. ``8bit``: encoded with a gamma of 1/2.2 and rounded
        to 8 bits, as pyrender's own framebuffer has it, then decoded: steps of 1.5 DN at 128 DN and 0.4 DN at 10 DN.
    colour_factor, event_factor
        Fragments along each side of a pixel of the colour and of the event camera. An event pixel is 2.25 colour
        pixels wide, so that about twice as many give both the same texture.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    precision: Precision = "float"
    colour_factor: int = 2
    event_factor: int = 4

    def __post_init__(self) -> None:
        if self.precision not in ("float", "8bit"):
            raise ValueError(f"Expected precision to be 'float' or '8bit', got {self.precision!r}")
        for name in ("colour_factor", "event_factor"):
            if not 1 <= getattr(self, name) <= 16:
                raise ValueError(f"Expected {name} from 1 to 16, got {getattr(self, name)}")
