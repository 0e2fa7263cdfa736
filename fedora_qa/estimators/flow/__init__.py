"""Optical flow against frames, depth and events."""
