"""Draws finished records. Never opens a sequence, never computes a result."""
