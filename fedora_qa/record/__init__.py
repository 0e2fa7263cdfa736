"""The record: what a run found, as frozen values that every output is drawn from."""
