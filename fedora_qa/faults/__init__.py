"""Faults as views of a sequence: rows altered as they are read. The one place that knows how a fault alters a sequence.

Canaries plant them. The same alterations undo them: ``timestamps.shifted_ns(-offset)`` undoes a time offset.
"""
