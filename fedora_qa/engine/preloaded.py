"""Importing this ends the loading into the process that worker processes are forked from."""

import gc

# A collection writes into each object that it scans, and would copy its page in every forked worker.
gc.freeze()
gc.enable()
