"""Depth frames: their values, and each against the next by the camera's motion."""
