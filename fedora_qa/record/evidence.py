"""The names of the arrays beside a record, and the content of each; reports draw from these arrays alone.

Names are paths. Streams that a file does not have leave their arrays out; what could not be decoded is NaN, or 0 in
whole numbers. Pictures are made smaller by averaging, so they show values of the file's own units. Every array has a
title in the record that can serve as its caption. Times are on the file's clock.

``moments/...``
    A few instants, evenly spread. n moments; every picture of a stream has one size.

    ``times_us`` (n,) float64 · ``rgb`` (n, h, w, 3) uint8 as stored, of ``rgb_times_us`` (n,) float64 · ``depth_m``
    (n, h, w) float32, of ``depth_times_us`` (n,) float64 · ``flow_px`` (n, h, w, 2) float32, of the fastest rate whose
    interval begins there, in px of the *stored* image over ``flow_interval_us`` (n, 2) float64 · ``residual_dn``
    (n, h, w) float16: luma of the frame at the end of that interval, carried back by the flow, minus luma of the frame
    at its start · ``brighter``,
    ``darker`` (n, h, w) uint16: events within ``events_interval_us`` (n, 2) float64, summed over the pixels that one
    pixel of the picture stands for. Where a moment lacks a picture of a stream, that stream's instants are NaN.
``places/<finding id>/...``
    What the streams show where a finding is worst: the arrays of a moment without their first axis, the flow of the
    rate that the finding names, and ``box`` (4,) float64: left, top, right, bottom of the worst pixel or tile as shares
    of the picture, 0 to 1, (0, 0, 1, 1) where the finding is of the whole picture. Findings at one place share the
    pictures of the first of them. Under ``places/<finding id>/before/...`` and ``.../after/...`` lie the same arrays of
    one frame earlier and later, without a box, as far as the limit of images of the follow-up allows.
``event_clouds/...``
    Single events around c of the moments, those with most events, in the order of time. ``times_us`` (c,) float64 ·
    ``intervals_us`` (c, 2) float64: start and end of 20 ms around each · ``counts`` (c,) int64: events within them ·
    ``shapes_px`` (c, 2) int64: height and width of the sensor. Of these events at most 4000 a moment are kept, evenly
    thinned in the order of time, m in all: ``instant`` (m,) uint8, the row of ``times_us`` · ``x``, ``y`` (m,) uint16
    px · ``offsets_us`` (m,) int16, from that instant on · ``polarities`` (m,) uint8: 1 brighter, 0 darker.
``point_cloud/...``
    Points of the depth frames nearest to k of the moments, evenly chosen, carried into the world by depth, pose and the
    depth camera with its lens: p_world = T_world_body T_body_camera p_camera. ``times_us`` (k,) float64 of the frames ·
    ``origin_world_m`` (3,) float64: position of the body at the first of them · ``offsets_m`` (n, 3) float32: points
    relative to it, axes of the world · ``rgb`` (n, 3) uint8 as stored, 128 where colour and depth have no common grid.
    At most 6000 points, on a grid of the pixels of each frame.
``trajectory/...``
    n poses: ``times_us`` (n,) float64 · ``positions_world_m`` (n, 3) float64 as stored · ``speeds_m_s`` (n,) float64,
    smoothed as the statistics are, NaN where too few poses are there · ``forward_world`` (n, 3) float64: the body's X
    axis.
``frusta/<camera>/...``
    The view of a camera at f of these poses, evenly chosen, by its declared intrinsics, lens and mounting: of
    ``rgb``, or else of ``depth`` or ``events``. ``times_us`` (f,) float64 · ``centres_world_m`` (f, 3) float64: its
    centre of projection · ``rays_world`` (f, 4, 3) float64: from there to the top left, top right, bottom right and
    bottom left corner of the image, of length 1 along the optical axis, axes of the world.
``timeline/...``
    ``edges_us`` (b + 1,) float64, and ``<stream>`` (b,) int64 (``timeline/flow/10hz``): samples of the stream within
    each bin. Samples far outside the time that most streams share are in no bin. Events of windows that were not
    measured are spread evenly over them. ``unmeasured/<stream>`` (k, 2) float64: start and stop of each segment
    of time in which only the timestamps of the stream were read, us; kept of colour, depth, events and flow, where
    there is one.
``histograms/<quantity>/...``
    ``edges`` (b + 1,) float64 and ``counts`` (b,) int64; bins of equal width from 0 on. The title of ``counts`` states
    what is counted, its unit, and the share that lies above the last bin. Quantities: ``depth_m``, ``luma_dn``,
    ``flow_10hz`` (px over its interval) and so on, ``event_rate_hz`` (of each pixel).
``distributions/...``
    Counts by which files are compared, in each of b blocks of time. ``blocks_ns`` (b, 2) int64: start and stop
    of each, ns from the file's origin · ``<quantity>/counts`` (b, n) int64 · ``<quantity>/edges`` (n + 1,) float64, a
    part of edges that are the same for all files: 0, and 16 bins of equal width an octave from 2^-10 to 2^21; the last
    of these holds what lies above. Quantities: ``QUANTITIES``, and ``flow_10hz`` (px over its interval) and so on.
``trials/<diagnosis id>/...``
    What undoing the fault of a diagnosis changes. ``deviations/<check>/<measurement>`` (2, 2) float64: deviation and
    limit of a measurement that had failed, before and after undoing, in its unit; the deviation is NaN where the check
    no longer states it · ``size`` (n, 2) float64, a series as those of checks: the largest deviation, in limits, by the
    size that is undone · ``before/...`` and ``after/...``: the arrays of a place, of those streams that undoing alters,
    and ``<check>/<name>``, the arrays that a check keeps, series of 500 points at most and maps averaged like pictures
    · ``box`` (4,) float64: the part of the image that these pictures show, as shares of it, (0, 0, 1, 1) for all of it.
    A part is kept where the fault displaces by a few pixels; its pixels are not averaged.
``agreement/<stream>/<stream>``
    (2,) int64: how many of the checks that compare two streams passed and failed; ``flow`` is every rate. Kept where a
    check failed.
``<check>/<name>``
    Arrays that a check keeps. An array (n, 2) of floats is a series of points whose title reads
    ``TITLE; x LABEL [UNIT]; y LABEL [UNIT]``; an array (h, w) is a map whose title reads ``TITLE [UNIT]``.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

MOMENTS: Final = "moments"
PLACES: Final = "places"
EVENT_CLOUDS: Final = "event_clouds"
POINT_CLOUD: Final = "point_cloud"
TRAJECTORY: Final = "trajectory"
FRUSTA: Final = "frusta"
FRUSTUM_CAMERAS: Final = ("rgb", "depth", "events")
"""Cameras of which the first that is declared has its frusta kept."""

TIMELINE: Final = "timeline"
UNMEASURED: Final = "unmeasured"
"""Group below the timeline."""

HISTOGRAMS: Final = "histograms"
DISTRIBUTIONS: Final = "distributions"

TRIALS: Final = "trials"
AGREEMENT: Final = "agreement"

DEVIATIONS: Final = "deviations"
BEFORE_UNDOING: Final = "before"
AFTER_UNDOING: Final = "after"
"""Groups below a trial."""

BESIDE: Final[Mapping[str, int]] = MappingProxyType({"before": -1, "after": 1})
"""Groups below a place, and the distance of their snapshot from it in frames."""

QUANTITIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "depth_m": "Pixels by depth, m",
        "luma_dn": "Pixels by luma of the stored codes, DN",
        "event_rate_per_ms": "Stretches of 5 ms by their events per ms",
        "pixel_interval_ms": "Times between events of a pixel up to 100 ms, ms",
    }
)
"""What is counted under ``distributions``, with its unit; flow of each rate besides."""


def named(*parts: str) -> str:
    """Return the name of an array from its parts."""
    return "/".join(parts)
