"""Samples of real data that public repositories hold, checked: ``make study-real-data PATHS='...'``.

Nothing is fetched, and nothing of the data is committed: docs/real-data.md states what was measured on which samples.
"""
