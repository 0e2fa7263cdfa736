"""Canaries, by subject: the fault that each check must detect, with a size that follows from its detection limit.

Where a canary plants a fault that can be undone, it builds that fault and calls ``plant``.
"""
