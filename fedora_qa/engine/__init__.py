"""Run the checks over a file: timestamps first, fixed windows, one measuring pass, one bounded follow-up."""
