"""Score predictions against a sequence: flow, depth and its reciprocal, disparity, and pose.

Read in this order: ``flow_errors``, ``depth_errors`` and ``trajectory_errors`` (the metrics, with their sources; arrays
in, numbers out) with ``error_sums`` (sums that merge, over near and far pixels, beside edges, on moving objects);
``predictions`` (what a learner wrote) and ``pairing`` (which rows of the sequence it is of); ``score`` (one sequence,
field by field); ``types`` (the document) and ``tables``.
"""
