"""Evidence for a reader of the report, kept by the measuring pass within a limit of size; it is not judged.

In order of reading: ``options`` is how much is kept. ``collector`` keeps ``histograms``, the timeline and snapshots
window by window, and ``distributions`` keeps what files are compared by; both count with ``value_counts``. A
``snapshot`` has ``pictures`` that are averaged; single events of the busiest snapshots, and depth in the world, are
kept as ``clouds``. After judgement ``worst_locations`` takes further snapshots, and ``trajectory`` keeps the poses. All
of it are ``titled_arrays``, whose names, shapes and units are those of ``record/evidence.py``.
"""
