"""Arguments and help of the commands whose work loads much: a file each, which imports the work when it runs.

The work is in the file of the same name in ``fedora_qa.cli``.
"""
