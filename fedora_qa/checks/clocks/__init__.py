"""Checks of stamps and index maps."""
