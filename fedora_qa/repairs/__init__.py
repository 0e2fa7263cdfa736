"""Write a copy of a file in which confirmed, mechanical faults are undone, and check the copy.

Read ``repair`` (what is done, in order), then ``mechanical`` (which faults) and ``write`` (how values return).
"""
