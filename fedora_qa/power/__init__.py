"""What the checks can see, measured: detection and false alarms over a corpus of files with a manifest.

``manifest`` reads what was planted, ``study`` checks the files and keeps what was found; ``probit`` and ``binomial``
are the statistics; ``detection``, ``naming``, ``magnitudes`` and ``stated_limits`` the tables, ``tables`` all of them;
``worth`` is what a passed check is worth, as published.
"""
