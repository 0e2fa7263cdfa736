"""The layout of a file: which canonical datasets there are, where a given file keeps them, and in which dialect.

In order of reading: ``canonical`` is the layout as data, and ``create`` writes a dataset of it. A ``dialect`` gives
the places of the same datasets in another layout. ``resolve`` finds them in a file, in the dialect that ``detect``
recognises, and ``binding`` reads their rows in canonical units. ``links`` and ``external_files`` find objects;
``bounds`` and ``filters`` refuse datasets that are unsafe to decode; ``stored_attribute`` reads attributes;
``direct_chunks`` decodes large images, and ``chunk_writer`` compresses chunks in threads. ``describe``, ``draft`` and
``draft_folder`` serve `fedora-qa layout`; ``walk`` lists the datasets.

A sequence may be a folder: ``folder`` matches its files with the roles of a dialect, ``conversions`` converts what is
more than a unit away, and ``metadata`` evaluates what a dialect declares. Rows outside of HDF5 come from
``fedora_qa.sources``.
"""
