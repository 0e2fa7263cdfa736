"""The gate: compares a release of many sequences with a policy, and certifies what was checked.

Read in this order: ``release`` (a folder of sequences, and results about it) and ``policy`` (what must hold);
``contents`` and ``rules`` (rules about the release); ``acceptance`` (what findings count); ``verdict`` (all of them, in
order); ``certificate``.
"""
