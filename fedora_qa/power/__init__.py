"""The power of the checks, measured: detection and false alarms over a corpus of files with a manifest.

``manifest`` reads what was planted, ``study`` checks the files and stores what was found. ``probit`` and ``binomial``
are the statistics. ``detection``, ``naming``, ``magnitudes`` and ``stated_limits`` make the tables, ``tables`` all of
them. ``detection_power`` is the published table of what each check detects.
"""
