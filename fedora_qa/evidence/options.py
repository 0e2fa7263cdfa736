"""Amount of evidence that is kept."""

from dataclasses import dataclass

MEBIBYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class EvidenceOptions:
    """Amount of evidence of one file.

    Attributes
    ----------
    size_bytes
        Uncompressed size of the pictures that the pass keeps, and again of the pictures of and beside the worst
        locations. All other evidence (series, histograms, distributions, trajectory, clouds) takes less than 3 MiB.
    picture_width_px
        Largest width of pictures, px; they are smaller where the size requires it.
    snapshots, worst_locations, beside
        Number of snapshots, largest number of worst locations, and number of locations for which the frames beside them
        are kept.
    trials
        Largest number of diagnoses of which is kept what undoing their fault changes.
    timeline_bins, trajectory_points, frusta
        Number of bins of the timeline, largest number of poses, and of those at which the view of a camera is kept.
    event_clouds, cloud_events
        Largest number of snapshots of which single events are kept, and largest number of events of each.
    point_clouds, cloud_points
        Largest number of snapshots whose depth is carried into the world, and largest number of all points.
    """

    size_bytes: int = 28 * MEBIBYTE
    picture_width_px: int = 360
    snapshots: int = 20
    worst_locations: int = 9
    beside: int = 6
    trials: int = 3
    timeline_bins: int = 200
    trajectory_points: int = 4000
    frusta: int = 12
    event_clouds: int = 3
    cloud_events: int = 4000
    point_clouds: int = 5
    cloud_points: int = 6000
