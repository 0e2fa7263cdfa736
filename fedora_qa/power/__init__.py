"""The power of the checks, measured: detection and false alarms over a corpus of files with a manifest.

In order of reading: ``manifest`` reads what was planted. ``study`` checks the files and stores what each result says.
``probit`` fits the probability of detection against size. ``detection`` and ``stated_limits`` make tables; ``tables``
makes those of named causes and of magnitudes, and the study of all. ``detection_power`` is what is published: what each
check detects, and how often diagnoses are right.
"""
