"""Quantities that several checks use, derived once per window; no verdicts."""
