"""Checks of events: their stream by itself, and against the frames."""
