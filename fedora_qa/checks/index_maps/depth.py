"""The map from depth frames to events."""

from fedora_qa.checks.index_maps.frame_to_event import _FrameToEvent


class IndexMapsDepth(_FrameToEvent):
    """Is each entry of depth_to_event the earliest event not before its depth frame?

    The number of entries that differ from the definition, and the rule that reproduces them.

    Why it matters
    --------------
    Loaders select the events between two depth frames by these indices alone. An index that is off by one adds an event
    of the neighbouring slice to each slice. A map of other timestamps selects events of another time, and no other
    stream shows the error.

    How
    ---
    As in ``index_maps.rgb``, with the timestamps of depth: entries must be exactly searchsorted(t_event, t_frame,
    "left"), and wrong entries are compared with common wrong rules.

    Noise model
    -----------
    None: an entry is correct or wrong.

    Cannot detect
    -------------
    Wrong timestamps: a map that was made of late timestamps is correct.

    Sources
    -------
    The canonical layout, version 1.0, after the dataset's paper: ``frame[i] = k``, k the index of the earliest event
    with t_k >= t_frame[i].
    """

    name = "index_maps.depth"
    needs = ("depth_to_event", "depth", "events")
    stream = "depth_to_event"
    frames = "depth"
