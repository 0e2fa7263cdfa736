"""The record: the results of a run, as frozen values that every output is drawn from.

In order of reading: ``types`` are the values of a record, ``evidence`` the names of the arrays beside it.
``documents`` are written as JSON and read back: a record by ``json_io``, a study of power (``power_types``) by
``power_json``. ``several_files`` says what files are together, ``wording`` puts a record into words, ``tables`` into
columns, ``problems`` into what CI systems show. ``markdown``, ``csv_tables``, ``junit``, ``sarif``, ``github`` and
``notebook`` are the other outputs, ``power_tables`` those of a study; a ``text_table`` is shown in several. ``schemas``
are the published JSON schemas; ``atomic`` writes files.
"""
