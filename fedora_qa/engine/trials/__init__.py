"""Measure a file again with its rows altered: to test the checks, and to name the causes of findings.

In order of reading: ``views`` are altered sequences of one file, and what they share; ``altered`` measures some
windows of a view. ``canaries`` plant a fault for each check. ``trial`` undoes a proposed fault,
and ``deviations`` compares what was measured with it undone; ``inquiry`` undoes those of all candidates in turn, and
``evidence`` keeps what that changed for the report. ``explanation`` names the causes of a file, and
``composite_faults`` one after the other.
"""
