"""The package as a library: a function for each command, with a result that a notebook shows.

Read ``check`` and then ``checked`` (the record that it returns); ``gate``, ``compare``, ``stats``, ``repair`` and
``explain`` do what the commands of their names do; ``sequence`` opens a file. ``options`` turns what Python passes into
the options of commands.
"""
