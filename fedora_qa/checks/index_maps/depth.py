"""The map from depth frames to events."""

from fedora_qa.checks.index_maps.frame_to_event import _FrameToEvent


class IndexMapsDepth(_FrameToEvent):
    """Does depth_to_event name the earliest event not before each depth frame?

    The entries that differ from the definition are counted, and what made them is named.

    Why it matters
    --------------
    Loaders cut the events between two depth frames by these numbers alone. An entry that is off by one gives each slice
    one event of its neighbour; a map of other stamps gives events of another time, and nothing else shows it.

    How
    ---
    As ``index_maps.rgb``, with the stamps of depth: exactly searchsorted(t_event, t_frame, "left"), and wrong entries
    tried against the rules that makers of files follow by mistake.

    Noise model
    -----------
    None: an entry is right or wrong.

    Cannot see
    ----------
    Whether the stamps themselves are right: a map that follows late stamps is right.

    Sources
    -------
    The canonical layout, version 1.0, after the dataset's paper: ``frame[i] = k``, k the index of the earliest event
    with t_k >= t_frame[i].
    """

    name = "index_maps.depth"
    needs = ("depth_to_event", "depth", "events")
    stream = "depth_to_event"
    frames = "depth"
