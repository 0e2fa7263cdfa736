"""The names of the arrays that lie beside a record, and what each holds: all that a report draws from.

Names are paths. Streams that a file does not have leave their arrays out; what could not be decoded is NaN, or 0 in
whole numbers. Pictures are made smaller by averaging, so they show values of the file's own units.

``moments/...``
    A few instants, evenly spread. n moments; every picture of a stream has one size.

    ``times_us`` (n,) float64 on the file's clock · ``rgb`` (n, h, w, 3) uint8 as stored · ``depth_m`` (n, h, w) float32
    · ``flow_px`` (n, h, w, 2) float32, of the fastest rate whose interval begins there, in px of the *stored* image
    over ``flow_interval_us`` (n, 2) float64 · ``brighter``, ``darker`` (n, h, w) uint16: events within
    ``events_interval_us`` (n, 2) float64, summed over the pixels that one pixel of the picture stands for.
``places/<finding id>/...``
    What the streams show where a finding is worst: the arrays of a moment without their first axis, and
    ``box`` (4,) float64: left, top, right, bottom of the worst pixel or tile as shares of the picture, 0 to 1,
    (0, 0, 1, 1) where the finding is of the whole picture.
``trajectory/...``
    ``times_us`` (n,) float64 · ``positions_world_m`` (n, 3) float64 · ``speeds_m_s`` (n,) float64, smoothed as the
    statistics are · ``forward_world`` (n, 3) float64: the body's X axis.
``timeline/...``
    ``edges_us`` (b + 1,) float64, and ``<stream>`` (b,) int64: samples of the stream within each bin.
``histograms/<quantity>/...``
    ``edges`` (b + 1,) float64 and ``counts`` (b,) int64. The title of ``counts`` says what is counted, and its unit.
``<check>/<name>``
    Arrays that a check keeps (``flow_geometry.endpoint/...``), each with a title of its own.
"""

from typing import Final

MOMENTS: Final = "moments"
PLACES: Final = "places"
TRAJECTORY: Final = "trajectory"
TIMELINE: Final = "timeline"
HISTOGRAMS: Final = "histograms"


def named(*parts: str) -> str:
    """Return the name of an array from its parts."""
    return "/".join(parts)
