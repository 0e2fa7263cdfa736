"""Depth frames: their consistency between frames, the steps in which they were stored, and their edges."""
