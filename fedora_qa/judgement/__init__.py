"""From measurements to verdicts: limits from one false-alarm rate for each file, outcomes of checks, verdicts."""
