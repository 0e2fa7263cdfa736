"""The mesh world measured against the exact one: ``python -m fedora_generator.mesh.study`` prints the tables."""
