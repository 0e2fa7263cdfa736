"""The command line. Results go to stdout, progress and messages to stderr.

Read in this order: ``main`` (the table of commands, exit codes of errors) with ``lazy_group``, and ``startup``;
``commands`` (arguments and help) with ``options`` (shared by commands) and ``parameters`` (their types); ``check`` with
``settings``, ``check_all`` (runs over many files), ``resume`` and ``record``; ``outputs`` with ``arrays``, ``html`` and
``parquet`` (what is written); ``summary`` with ``console`` and ``progress`` (what is printed). Every other command is a
file of its name; ``explain`` holds ``checks`` as well. ``gate_release`` is the work of ``gate``, ``measured_file`` that
of ``stats`` and ``compare``. ``isolated`` and ``isolated_light`` read a file in a process of its own. ``check_pages``
and ``schema_files`` write files of the repository.
"""
