"""Write a copy of a file in which confirmed, mechanical faults are undone, and check the copy.

Read ``repair`` (what is done, in order), then ``mechanical`` (which faults), ``write`` (how values return) and
``result`` (what was done, and whether it is better).
"""
