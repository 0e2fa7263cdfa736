"""Estimators of how values are stored."""
