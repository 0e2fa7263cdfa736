"""Hypotheses for events against frames."""
