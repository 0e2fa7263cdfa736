"""The package as a library: check files, read their records as data frames, and show them in a notebook.

Read ``check`` (the functions) and then ``checked`` (the record that they return).
"""
