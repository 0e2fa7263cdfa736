"""Colour frames, alone and against events."""
