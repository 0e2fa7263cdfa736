"""Sequences, datasets, or two versions of a release side by side: distances, their uncertainty, and what changed.

Read in this order: ``types`` (the document), ``subjects`` (the input), ``compare`` (also of two versions),
``distances`` (of distributions), ``tables`` (conclusions and tables) and ``paper_tables``.
"""
