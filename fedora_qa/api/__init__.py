"""The package as a library: a function for each command, with a result that a notebook shows.

Read ``check``, with the record that it returns; ``gate``, ``compare``, ``stats``, ``repair``, ``score`` and ``explain``
do what the commands of their names do; ``sequence`` opens a file. ``options`` turns what Python passes into the options
of commands.
"""
