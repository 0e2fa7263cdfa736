"""Sequences, datasets, or two versions of a release side by side: distances, their uncertainty, and what changed."""
