"""Faults as views of a sequence: rows are altered when they are read.

No other package defines how a fault alters a sequence. Canaries plant the faults. The same alterations undo them:
``timestamps.shifted_ns(-offset)`` undoes a time offset.
"""
