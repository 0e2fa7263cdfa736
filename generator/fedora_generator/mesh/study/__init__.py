"""The mesh world measured against the exact world: ``python -m fedora_generator.mesh.study`` prints the tables.

``workbench`` is the world and the flight. ``agreement`` compares depth and radiance, ``event_timing`` compares events.
``stock`` is the depth of pyrender's own renderer, ``interpolation`` a trial with fewer renders.
"""
