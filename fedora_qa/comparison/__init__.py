"""Sequences, datasets, or two versions of a release side by side: distances, their uncertainty, and what changed.

Read in this order: ``types`` (the document), ``subjects`` and ``distributions`` (the input), ``compare``; ``distances``
(of distributions), ``versions`` (records and statistics); ``conclusions``, ``tables`` and ``paper_tables``.
"""
