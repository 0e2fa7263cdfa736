"""The map from colour frames to events."""

from fedora_qa.checks.index_maps.frame_to_event import _FrameToEvent


class IndexMapsRgb(_FrameToEvent):
    """Does rgb_to_event name the earliest event not before each colour frame?

    The entries that differ from the definition are counted, and what made them is named.

    Why it matters
    --------------
    Loaders cut the events between two frames by these numbers alone. An entry that is off by one gives each slice one
    event of its neighbour; a map of other stamps gives events of another time, and nothing else in the file shows it.

    How
    ---
    Exact: searchsorted(t_event, t_frame, "left") on the stamps as stored, the number of events where none is left.
    Wrong entries are tried against the rules that makers of files follow by mistake: behind equal stamps, off by a
    constant, the nearest event, the last event where none is left, zeros, the other camera's map, a neighbouring frame;
    and else against events that are late by a time, or by one that grows (their deviation over the local event rate).
    The rule is named that gives nine tenths of the wrong entries, and of several the one that gives most entries. Where
    the clock of the events was set for a while (``clocks.order``), and all wrong entries lie where that tells, it is
    suspected first: the map may be older.

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

    name = "index_maps.rgb"
    needs = ("rgb_to_event", "rgb", "events")
    stream = "rgb_to_event"
    frames = "rgb"
