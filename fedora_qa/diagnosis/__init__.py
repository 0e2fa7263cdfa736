"""Infer causes from the features of failed measurements; runs only after an alarm."""
