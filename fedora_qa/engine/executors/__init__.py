"""Do tasks: in this process, in processes of this machine, or on a cluster.

In order of reading: ``executor`` is a task, the worker that does it, and the executor of this process. ``processes``
does tasks in processes of this machine, which come from the ``fork_server``; ``cluster`` does them on Dask.
"""
