"""Compile the loops of checks on all cores before they are needed.

``kernel_groups`` reads ``kernels.json``, the list of compiled functions; ``kernels`` compiles a group of them.
"""
