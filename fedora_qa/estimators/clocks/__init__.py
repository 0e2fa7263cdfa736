"""Timestamps of regular clocks."""
