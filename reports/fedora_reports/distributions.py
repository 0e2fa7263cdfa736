"""How values are distributed: histograms of the whole sequence, on even axes or, of what spans decades, by octaves."""

from typing import Final

import numpy as np

from fedora_qa.record.evidence import DISTRIBUTIONS, QUANTITIES, named
from fedora_qa.record.wording import number
from fedora_reports.charts import HEIGHT, WIDTH, Chart, histograms_of, steps_path
from fedora_reports.evidence import Evidence
from fedora_reports.scales import Axis

_BY_OCTAVES: Final = ("event_rate_per_ms", "pixel_interval_ms")
"""Quantities that only the counts by block of time hold."""


def distributions_of(evidence: Evidence) -> tuple[Chart, ...]:
    """Return the histograms of flow, depth, light and events that can be drawn."""
    by_octaves = (_octaves(evidence, quantity) for quantity in _BY_OCTAVES)
    return (*histograms_of(evidence), *(chart for chart in by_octaves if chart is not None))


def _octaves(evidence: Evidence, quantity: str) -> Chart | None:
    """Draw counts (blocks, bins) of all blocks together: values an octave against the logarithm of the value."""
    edges = evidence.numbers(named(DISTRIBUTIONS, quantity, "edges"), None)
    bins = 0 if edges is None else len(edges) - 1
    counts = evidence.numbers(named(DISTRIBUTIONS, quantity, "counts"), None, bins)
    if edges is None or counts is None or not np.isfinite(edges).all() or not (np.diff(edges) > 0).all():
        return None
    totals = np.asarray(counts, dtype=np.float64).sum(axis=0)
    lasting = edges[:-1] > 0  # the bin that begins at 0 has no place on a logarithmic axis
    if not np.isfinite(totals).all() or (totals < 0).any() or not totals[lasting].any():
        return None
    drawn_edges, heights = edges[-1 - int(lasting.sum()) :], totals[lasting]
    per_octave = heights / np.log2(drawn_edges[1:] / drawn_edges[:-1])
    axis = Axis(float(drawn_edges[0]), float(drawn_edges[-1]), logarithmic=True)
    most = int(per_octave.argmax())
    left_out = float(totals.sum() - heights.sum())
    below = f"; {number(left_out)} below are not drawn" if left_out else ""
    title = QUANTITIES[quantity]
    return Chart(
        title=title,
        path=steps_path(list(axis.shares(drawn_edges) * WIDTH), list(per_octave / per_octave.max() * HEIGHT)),
        filled=True,
        ticks=axis.ticks(),
        across=f"logarithmic{below}",
        up="number an octave",
        lowest="0",
        highest=number(float(per_octave.max())),
        alt=f"Histogram. {title}: from {number(axis.low)} to {number(axis.high)}, "
        f"most between {number(float(drawn_edges[most]))} and {number(float(drawn_edges[most + 1]))}",
    )
