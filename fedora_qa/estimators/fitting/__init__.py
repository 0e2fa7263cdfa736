"""Robust scale, tails, least squares and quantiles, shared by all subjects."""
