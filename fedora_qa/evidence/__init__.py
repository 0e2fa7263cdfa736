"""Evidence for a reader of the report, collected by the measuring pass within a size cap: pictures, series, histograms.

Names, shapes and units of the arrays are those of ``record/evidence.py``. Evidence is not judged.
"""
