"""Faults as views of a sequence: rows are altered when they are read.

No other package defines how a fault alters a sequence. ``table.py`` lists the fault of each cause. Canaries plant them
(``canaries/``), and the same objects undo them: ``ClockShift("imu", 2e6).undo(facts, sequence)``.
"""
