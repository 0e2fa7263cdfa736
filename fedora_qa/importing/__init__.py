"""Write a canonical file from a recording: streamed block by block, entirely or not at all.

In order of reading: ``run`` recognises the format from the first bytes and puts the others together. A format has a
file each (``evt2``, ``evt3``, ``dat``, ``aedat4``, ``ros_bag`` with ``ros1_bag``), which turns the bytes of a recording
into blocks of rows in canonical units (``recording``). ``prophesee`` chooses between the first three, which share
``prophesee_file``. ``compressed`` reads the packets of AEDAT, ``ros_messages`` what a bag holds. ``sequence_writer``
writes blocks in the canonical layout.
"""
