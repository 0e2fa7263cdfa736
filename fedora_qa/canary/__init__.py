"""Faults planted in memory, as a view of a sequence: the run proves its own checks alive.

Independent of the generator: what each fault alters follows from the format's definitions alone.
"""
