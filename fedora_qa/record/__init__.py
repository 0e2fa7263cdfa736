"""The record: the results of a run, as frozen values that every output is drawn from.

In order of reading: ``types`` are the values of a record, ``evidence`` the names of the arrays beside it.
``documents`` are written as JSON, read back, and published as schemas: a record by ``json_io``, a study of power by
``power_study``. ``wording`` puts a record into words, ``tables`` into columns. ``markdown``, ``latex``, ``ci``,
``sarif`` and ``notebook`` are the other outputs. ``atomic`` writes files.
"""
