"""From measurements to verdicts: limits from one false-alarm rate for each file, outcomes of checks, verdicts.

Read ``judge`` (limits and outcomes), with ``materiality`` (which sizes matter) and ``places`` (which findings are one);
then ``verdict``.
"""
