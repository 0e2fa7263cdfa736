"""The gate: compares a release of many sequences with a policy, and certifies what was checked.

Read in this order: ``release`` (a folder of sequences) and ``policy`` (what must hold); ``contents`` and ``rules`` with
``release_result`` (rules about the release); ``severity_override``, ``waivers`` and ``baseline`` (what findings count);
``verdict`` (all of them, in order); ``certificate``.
"""
