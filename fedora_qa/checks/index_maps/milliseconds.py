"""The map from milliseconds to events."""

from fedora_qa.checks.index_maps.frame_to_event import MapWords, map_observation
from fedora_qa.checks.protocol import FactsCheck, Observation
from fedora_qa.sequence.facts import Facts


class IndexMapsMilliseconds(FactsCheck):
    """Is each entry of the map from milliseconds the earliest event not before its millisecond?

    The number of entries that differ from the definition, and the rule that reproduces them.

    Why it matters
    --------------
    Loaders of DSEC and M3ED read no timestamp to find a slice of events: they take the entries of its first and last
    millisecond, and search only between them. Events outside the range of a wrong entry are never returned.

    How
    ---
    As in ``index_maps.rgb``, with the instants 0, 1, 2 ... ms of the clock of the stored events, before an offset such
    as ``t_offset`` is added: entries must be exactly searchsorted(t_event, k ms, "left"), which is the number of events
    where none is left.

    Noise model
    -----------
    None: an entry is correct or wrong.

    Cannot detect
    -------------
    Wrong timestamps: a map that was made of late timestamps is correct. Milliseconds that the map lacks at its end.

    Sources
    -------
    DSEC, ``scripts/utils/eventslicer.py`` (github.com/uzh-rpg/DSEC): t[ms_to_idx[k]] >= 1000 k and t[ms_to_idx[k] - 1]
    < 1000 k, t in microseconds, and ms_to_idx[0] = 0; M3ED, ``build_system/bag_processing/rosbag2hdf5.py``
    (github.com/daniilidis-group/m3ed), ``ms_map_idx``.
    """

    name = "index_maps.milliseconds"
    needs = ("events",)

    def not_applicable(self, facts: Facts) -> str:
        """Require the map."""
        return "" if facts.millisecond_map else "the sequence has no map from milliseconds to events"

    def examine(self, facts: Facts) -> Observation:
        """Count entries that differ from the definition."""
        milliseconds = facts.millisecond_map
        if milliseconds is None:
            raise ValueError("Expected a map from milliseconds to events, got none; ask not_applicable first")
        words = MapWords(self.name, "ms_to_event", "events", "millisecond")
        return map_observation(facts, milliseconds.index_map, milliseconds.instants_ns, words)
