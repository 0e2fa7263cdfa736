"""Time of the header of a message of ROS, and the error of a message that cannot be read."""

from typing import Any

from fedora_qa.conventions import NS_PER_S, NS_PER_US


class UnreadableMessageError(Exception):
    """A message is not as its type has it, or of a form that is not read; the text completes "got"."""


def header_time_us(header: Any) -> int:
    """Return the time of a header in whole us, rounded down, as all times are: their order stays."""
    return int(header.stamp.sec) * (NS_PER_S // NS_PER_US) + int(header.stamp.nanosec) // NS_PER_US
