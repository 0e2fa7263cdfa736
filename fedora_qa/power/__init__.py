"""The power of the checks, measured: detection and false alarms over a corpus of files with a manifest.

``manifest`` reads what was planted, ``study`` checks the files and stores what was found. ``probit`` and ``binomial``
are the statistics. ``detection``, ``naming`` and ``stated_limits`` make tables, ``tables`` that of sizes and all of
them together. ``detection_power`` is the published table of what each check detects.
"""
