"""Score predictions against a sequence: flow, depth and its reciprocal, disparity, and pose.

Read in this order: ``metrics`` (with their sources, and sums of errors; arrays in, numbers out); ``predictions``
(what a learner wrote); ``score`` (one sequence, field by field); ``types`` (the document) and ``tables``.
``fault_prices`` is what faults in training data cost.
"""
