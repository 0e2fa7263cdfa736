"""Units, axes, frames, time base and polarity: the one page.

Time       Files stamp in microseconds. Inside, time is int64 nanoseconds from the file's origin (the earliest
           first stamp of any stream), so that fractional microseconds survive and epoch stamps lose nothing.
Intervals  Half-open: ``start`` is included, ``stop`` is not.
Pixels     (column, row); an integer coordinate is a pixel centre. Flow is (u right, v down).
World      ENU: X east, Y north, Z up. Gravity is (0, 0, -g).
Body       X forward, Y left, Z up. Pose takes body to world: ``p_world = R_world_body p_body + position``.
Optical    Z forward, X right, Y down. ``p_body = T_body_camera p_optical``.
Transforms ``T_to_from``, 4x4, acting on column vectors.
Quaternion x, y, z, w; unit; q and -q are the same rotation.
Depth      z-depth along the optical axis, millimetres in files, metres inside; NaN is invalid.
Events     x column, y row, p 1 brighter and 0 darker.
Radiance   DN (0..255) of linear radiance unless ``transfer`` says otherwise.
"""

from typing import Final

FORMAT_NAME: Final = "fedora"
FORMAT_VERSION: Final = "1.0"

MS_PER_S: Final = 1_000
NS_PER_US: Final = 1_000
NS_PER_MS: Final = 1_000_000
NS_PER_S: Final = 1_000_000_000
US_PER_S: Final = 1_000_000
MM_PER_M: Final = 1_000.0

POLARITY_BRIGHTER: Final = 1
POLARITY_DARKER: Final = 0

STANDARD_GRAVITY_M_S2: Final = 9.80665

LUMA_WEIGHTS_RGB: Final = (0.299, 0.587, 0.114)
"""Luma of linear R, G, B (the weights of ITU-R BT.601, as format.md fixes them)."""

R_BODY_OPTICAL: Final = ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
"""Rotation of a camera that looks straight ahead: optical Z is body X, optical X is body -Y, optical Y is body -Z."""

SAME_AXES: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FRD_FROM_FLU: Final = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
"""A body of X forward, Y right, Z down from that of the format."""
NED_FROM_ENU: Final = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
"""A world of north, east, down from that of the format."""

HORIZONTAL_FIELD_OF_VIEW_DEG: Final = 60.0
"""All three cameras of the paper."""

EVENT_TO_RGB_WIDTH: Final = 640 / 1440
"""The event sensor scales with the colour camera by this ratio in both directions."""

FLOW_RATES_HZ: Final = (10, 25, 50)
"""The rates that the canonical layout names."""
