"""The layout of a file: which canonical datasets there are, where a given file keeps them, and in which dialect.

In order of reading: ``canonical`` is the layout as data, and ``create`` writes a dataset of it. A ``dialect`` gives
the places of the same datasets in another layout. ``resolve`` recognises the dialect of a file and finds the datasets
in it; ``dataset_binder`` opens each, and ``binding`` reads its rows in canonical units. ``hdf5_objects`` and
``external_files`` find objects and read attributes; ``decodable`` refuses datasets that are unsafe to decode;
``direct_chunks`` decodes large images, and compresses chunks in threads. ``describe``, ``guesses``, ``draft_file`` and
``draft_folder`` serve `fedora-qa layout`.

A sequence may be a folder: ``folder`` matches its files with the roles of a dialect, ``conversions`` converts what is
more than a unit away, and ``metadata`` evaluates what a dialect declares. Rows outside of HDF5 come from
``fedora_qa.sources``.
"""
