"""Write a canonical file from a recording: streamed block by block, entirely or not at all.

In order of reading: ``recognise`` names the format from the first bytes. A format has a file each (``evt2``, ``evt3``,
``dat``, ``aedat4``), which turns the bytes of a recording into blocks of rows in canonical units (``recording``).
``prophesee_header`` reads the head that the three share; ``flatbuffer`` and
``compressed`` read the packets of AEDAT. ``sequence_writer`` writes blocks in the canonical layout, and
``run`` puts them together.
"""
