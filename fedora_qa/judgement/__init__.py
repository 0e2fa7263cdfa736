"""From measurements to verdicts: limits at one false-alarm rate a file, outcomes, causes."""
