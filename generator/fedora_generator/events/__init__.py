"""The event camera: luminance in, events out, with the effects of a real sensor.

Read ``options`` (what a scene sets), then ``sensor`` (from images to events). ``comparator`` compares signals with
thresholds, ``quiet_kernels`` lists the few pixels that may have crossed one, ``noise`` adds effects. Events are int64
keys on their way (``keys``, ``key_kernels``) and columns at its end (``batch``). ``light`` is the interface to a source
that is known at all times (``adaptive/``). ``stream`` writes the events of a flight into the file.
"""
