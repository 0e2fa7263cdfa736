"""The map from colour frames to events."""

from fedora_qa.checks.index_maps.frame_to_event import _FrameToEvent


class IndexMapsRgb(_FrameToEvent):
    """Is each entry of rgb_to_event the earliest event not before its colour frame?

    The number of entries that differ from the definition, and the rule that reproduces them.

    Why it matters
    --------------
    Loaders select the events between two frames by these indices alone. An index that is off by one adds an event of
    the neighbouring slice to each slice. A map of other timestamps selects events of another time, and no other stream
    shows the error.

    How
    ---
    Entries must be exactly searchsorted(t_event, t_frame, "left") of the stored timestamps, which is the number of
    events where no later event exists. Wrong entries are compared with common wrong rules: after equal timestamps, off
    by a constant, the nearest event, the last event where none is left, zero, the other camera's map, a neighbouring
    frame. If none of them fits, a delay of the events is fitted, constant or growing with time (deviation of the
    entries over the local event rate). A rule is named if it reproduces nine tenths of the wrong entries; of several
    rules, the one that reproduces most entries is named. Where the clock of the events was set for some time
    (``clocks.order``) and all wrong entries lie within that time, the clock is suspected first: the map may have been
    made before.

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

    name = "index_maps.rgb"
    needs = ("rgb_to_event", "rgb", "events")
    stream = "rgb_to_event"
    frames = "rgb"
