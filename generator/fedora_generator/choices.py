"""What a request chooses from: streams, qualities, durations and seeds."""

from typing import Final, Literal

STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", "flow")

Quality = Literal["draft", "standard", "reference"]
"""How closely events follow the light."""

DEFAULT_DURATION_S: Final = 2.0

MOST_SEED: Final = (1 << 63) - 1
"""A file stores the seed with 64 bits."""
