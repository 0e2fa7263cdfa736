"""Recompute what must hold between the streams of an event-camera sequence, and say what does not."""

__version__ = "0.1.0"
