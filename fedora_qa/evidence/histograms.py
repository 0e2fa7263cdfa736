"""Histograms of depth, flow, brightness and event rates over the decoded windows."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.evidence.pictures import LARGEST_SENSOR_PX, add_events
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.evidence.value_counts import Int64, added, count_values, histogram
from fedora_qa.record.evidence import HISTOGRAMS, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.statistics.moments import readable_samples, sampled_depth_m, sampled_luma_dn, sampled_speeds_px

UInt32 = NDArray[np.uint32]

_TITLES: Final = {
    "depth_m": "Sampled pixels by depth, m",
    "luma_dn": "Sampled pixels by luma of the stored codes, DN",
}


def window_values(window: Window, families: frozenset[str] | None = None) -> dict[str, Int64]:
    """Count sampled pixels of the images that a window owns, in the bins of ``value_counts``.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the counts.
    families
        Streams that are counted (``flow`` is every rate); None: all.

    Returns
    -------
    dict[str, Int64]
        (bins,) by quantity: ``depth_m``, ``luma_dn``, ``flow/10hz``, ...
    """
    return window.derived(_count_window, families)


def _count_window(window: Window, families: frozenset[str] | None) -> dict[str, Int64]:
    samples: dict[str, Iterable[NDArray[Any]]] = {
        "depth_m": readable_samples(window, "depth", sampled_depth_m, families=families),
        "luma_dn": readable_samples(window, "rgb", sampled_luma_dn, families=families),
    }
    for stream in window.facts.flow_streams:
        samples[stream] = readable_samples(window, stream, sampled_speeds_px, stream, families=families)
    return {quantity: added(count_values(image) for image in images) for quantity, images in samples.items()}


def with_events(counts: UInt32 | None, window: Window) -> UInt32:
    """Add the events of a window to the counts of their pixels.

    Parameters
    ----------
    counts
        (H, W) counts, changed in place where they are large enough; None for no counts.
    window
        A window with readable events.

    Returns
    -------
    ndarray of uint32
        (H, W), larger than ``counts`` where events lie outside of them.

    Raises
    ------
    UnreadableRowsError
        The events cannot be decoded.
    """
    rows = window.owned("events")
    x, y = (window.rows(f"path/events/{axis}", rows.start, rows.stop) for axis in "xy")
    camera = window.facts.declared.cameras.get("events")
    extent = (camera.height, camera.width) if camera else (int(v.max(initial=0)) + 1 for v in (y, x))
    height, width = (min(size, LARGEST_SENSOR_PX) for size in extent)
    counts = grown(np.zeros((0, 0), np.uint32) if counts is None else counts, height, width)
    add_events(counts, x, y)
    return counts


def grown(counts: UInt32, height: int, width: int) -> UInt32:
    """Return counts of pixels that cover a size at least: zero in added pixels, and the same array where none is added.

    Parameters
    ----------
    counts
        (H, W), not changed.
    height, width
        Least rows and columns.
    """
    if counts.shape[0] >= height and counts.shape[1] >= width:
        return counts
    larger = np.zeros((max(height, counts.shape[0]), max(width, counts.shape[1])), np.uint32)
    larger[: counts.shape[0], : counts.shape[1]] = counts
    return larger


def keep_histograms(values: Mapping[str, Int64], pixels: UInt32 | None, seconds: float) -> TitledArrays:
    """Return the histograms of all counted quantities.

    Parameters
    ----------
    values
        (bins,) counts by quantity.
    pixels
        (H, W) events of each pixel; None where none were counted.
    seconds
        Time over which events were counted, s.
    """
    histograms = []
    for quantity, counts in values.items():
        if counts.any():
            of_flow = f"Sampled pixels by length of {quantity}, px over its interval"
            histograms.append(_histogram(quantity, _TITLES.get(quantity, of_flow), counts))
    if pixels is not None and pixels.any() and seconds > 0:
        rates = count_values(pixels / seconds)
        histograms.append(
            _histogram("event_rate_hz", "Pixels of the event camera by their rate of events, events/s", rates)
        )
    return merged(histograms)


def seconds_of(facts: Facts, bounds_ns: Iterable[tuple[int, int]]) -> float:
    """Return the part of the time from the first to the last event that lies in some windows, s.

    Parameters
    ----------
    bounds_ns
        Start and stop of each window, ns from the file's origin.
    """
    if facts.events is None:
        return 0.0
    first, last = facts.events.first_ns, facts.events.last_ns
    return sum(max(min(stop, last) - max(start, first), 0) for start, stop in bounds_ns) / NS_PER_S


def padded_sum(earlier: UInt32, later: UInt32) -> UInt32:
    """Add counts of pixels, (H, W) of the larger height and the larger width; neither array is changed.

    Parameters
    ----------
    earlier, later
        (H, W) of any sizes.
    """
    total = grown(earlier, *later.shape)
    # ``grown`` returns its argument where that is large enough: states of two windows must not share an array.
    total = total.copy() if total is earlier else total
    total[: later.shape[0], : later.shape[1]] += later
    return total


def _histogram(quantity: str, title: str, counts: Int64) -> TitledArrays:
    edges, heights, beyond = histogram(counts)
    name = quantity.replace("flow/", "flow_")
    share = f"; {beyond / counts.sum():.2g} of them lie above" if beyond else ""
    return TitledArrays.titled(
        {
            named(HISTOGRAMS, name, "edges"): (edges, "Edges of the bins"),
            named(HISTOGRAMS, name, "counts"): (heights, title + share),
        }
    )
