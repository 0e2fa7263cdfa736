"""Depth frames, their steps and edges."""
