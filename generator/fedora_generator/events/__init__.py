"""The event camera: luminance in, events out, with the effects of a real sensor.

Read ``options`` (what a scene sets), then ``sensor`` (from images, or from light that is known at all times, to
events). ``comparator`` compares signals with thresholds where pixels may have crossed them, ``noise`` adds effects.
Events are int64 keys on their way and columns at its end (``keys``). ``stream`` writes the events of a flight into the
file.
"""
