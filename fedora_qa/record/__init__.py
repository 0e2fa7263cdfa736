"""The record: the results of a run, as frozen values that every output is drawn from.

In order of reading: ``types`` are the values of a record, ``evidence`` the names of the arrays beside it.
``documents`` are written as JSON, read back, and published as schemas: a record by ``json_io``, a study of power by
``power_types``. ``several_files`` states what files are together, ``wording`` puts a record into words, ``tables`` into
columns, ``problems`` into what CI systems show. ``markdown``, ``csv_tables``, ``latex``, ``junit``, ``sarif``,
``github``, ``badge`` and ``notebook`` are the other outputs, ``power_tables`` those of a study. ``atomic`` writes
files.
"""
