"""Checks of what a file declares."""
