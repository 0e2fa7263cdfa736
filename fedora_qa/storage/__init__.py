"""Files on this machine or behind a URL, of which only the requested bytes are transferred.

Read in this order: ``place`` (a path or a URL), ``version``, ``signature`` and ``digest`` (what a file is); for URLs
``remote_bytes``, ``server`` (requests), ``failures`` (their errors) and ``traffic``.
"""
