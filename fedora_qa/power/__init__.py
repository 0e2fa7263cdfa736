"""The power of the checks, measured: detection and false alarms over a corpus of files with a manifest.

In order of reading: ``manifest`` reads what was planted. ``study`` checks the files and stores a ``checked_file`` of
each. ``probit`` and ``binomial`` are the statistics, ``units`` compares magnitudes. ``detection``, ``naming`` and
``stated_limits`` make tables; ``tables`` makes that of magnitudes, and the study of all. ``detection_power`` is the
published table of what each check detects, with the digest of the code that it was measured with.
"""
