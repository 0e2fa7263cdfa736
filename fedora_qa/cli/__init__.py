"""The command line. Results go to stdout, progress and messages to stderr.

Read in this order: ``main`` (the table of commands, exit codes of errors) with ``lazy_group``, and ``startup``;
``commands`` (arguments and help) with ``options`` (shared by commands) and ``parameters`` (types and completion of
arguments); ``check`` with ``settings``, ``check_all`` (runs over many files), ``resume`` and ``record``; ``outputs``
with ``arrays``, ``html`` and ``parquet`` (what is written); ``summary`` with ``console`` and ``progress`` (what is
printed). Every other command is a file of its name; ``explain`` holds ``checks`` as well, and quotes the
``published_studies``. ``isolated`` and ``isolated_light`` read a file in a process of its own. ``check_pages``,
``schema_files`` and ``kernel_list`` write files of the repository, ``site_pages`` those of the site.
"""
