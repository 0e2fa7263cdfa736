"""Faults as views of a sequence: rows are altered when they are read.

No other package defines how a fault alters a sequence. Read ``fault`` (what a fault is), then ``table`` (the fault of
each cause); the other modules are named after what their faults alter, and ``image_part`` confines those of pixels to a
rectangle. Canaries stand beside the faults that they plant, and ``canary_conditions`` is what they are given;
``damage`` has canaries that nothing undoes. Other faults are undone by the same objects: ``ClockShift("imu",
2e6).undo(facts, sequence)``.
"""
