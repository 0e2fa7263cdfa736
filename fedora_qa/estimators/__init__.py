"""Estimators: arrays in, estimates with covariances out; they know neither files nor verdicts."""
