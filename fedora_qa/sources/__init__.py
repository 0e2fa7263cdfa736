"""Sources of rows that are not HDF5: folders of images, NPY and NPZ, columns of text; and documents with metadata.

Read ``source`` (what every source offers), then ``images``, ``arrays`` and ``text`` (also the documents). A source
states shape and type from headers and names alone, is small enough to be handed from process to process, and reads rows
where they are asked for. What a file states is compared with its bytes before any memory is taken for it.
"""
