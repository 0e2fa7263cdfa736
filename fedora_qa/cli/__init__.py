"""The command line. Results go to stdout, progress and messages to stderr.

Read in this order: ``main`` (the table of commands) with ``startup`` and ``exit_codes``; ``commands`` (arguments and
help) with ``options`` (shared by commands); ``check`` with ``settings``, ``sequences`` (which files), ``host``,
``resume`` and ``record``; ``outputs`` with ``arrays`` and ``documents`` (what is written); ``summary`` with ``console``
and ``progress`` (what is printed). Every other command is a file of its name, but for three: ``explain`` holds
``checks`` as well, ``summary`` holds ``report``, and ``gate`` holds ``verify``. ``explain`` quotes the
``published_studies``. ``isolated`` reads a file in a process of its own. ``generated_files`` and ``kernel_list`` write
files of the repository, ``site_pages`` those of the site, with ``markdown``.
"""
