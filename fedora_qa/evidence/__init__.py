"""Evidence for a reader of the report, kept by the measuring pass within a limit of size; it is not judged.

In order of reading: ``options`` is how much is kept. ``collector`` keeps ``histograms``, the timeline and snapshots
window by window, and ``distributions`` keeps what files are compared by; both count with ``value_counts``. A
``snapshot`` is taken at one of the ``snapshot_times``, from ``pictures`` that are averaged, and becomes arrays in
``snapshot_arrays``; single events of the busiest snapshots are kept as ``event_cloud``, and some of its depth in
the world as ``point_cloud``. After judgement
``worst_locations`` takes further snapshots, and ``trajectory`` keeps the poses. All of it are ``titled_arrays``, whose
names, shapes and units are those of ``record/evidence.py``.
"""
