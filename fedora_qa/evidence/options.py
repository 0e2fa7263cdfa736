"""How much evidence is kept."""

from dataclasses import dataclass

MEBIBYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class EvidenceOptions:
    """How much is kept of one file.

    Attributes
    ----------
    size_bytes
        Uncompressed size of the pictures that the pass keeps, and again of those of the worst
        locations and beside them.
        What else is kept (series, histograms, distributions, trajectory) stays below 3 MiB.
    picture_width_px
        Width that pictures do not exceed; they are smaller where the size would not hold them.
    snapshots, worst_locations, beside
        How many snapshots are kept, at most how many worst locations, and at how many of these the frames beside them.
    timeline_bins, trajectory_points
        How finely the samples of the streams are counted over time, and at most how many poses are kept.
    """

    size_bytes: int = 28 * MEBIBYTE
    picture_width_px: int = 360
    snapshots: int = 20
    worst_locations: int = 9
    beside: int = 6
    timeline_bins: int = 200
    trajectory_points: int = 4000
