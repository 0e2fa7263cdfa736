"""Write a canonical file from a recording: streamed block by block, entirely or not at all.

In order of reading: ``recognise`` names the format from the first bytes. A format has a file each (``evt2``,
``evt3``, ``dat``, ``aedat4``, ``ros_bag`` with ``ros1_bag``), which turns the bytes of a recording into blocks of rows
in canonical units (``recording``). The first three share ``word_decoder`` and ``prophesee_header``. ``flatbuffer`` and
``compressed`` read the packets of AEDAT; ``ros_topics`` and ``ros_messages`` read what a bag holds.
``sequence_writer`` writes blocks in the canonical layout, and ``run`` puts them together.
"""
