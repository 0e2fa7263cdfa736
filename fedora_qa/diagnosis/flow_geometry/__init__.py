"""Causes of disagreements between flow, depth and the camera's motion."""
