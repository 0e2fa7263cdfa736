"""What several checks look at, derived once per window; no verdicts."""
