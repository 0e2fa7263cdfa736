"""Files on this machine or behind a URL, of which only the requested bytes are transferred.

Read in this order: ``place`` (a path or a URL), ``folder`` (files and versions), ``signature`` and ``digest`` (what a
file is); for URLs ``remote_bytes`` and ``server`` (requests, their number and their errors).
"""
