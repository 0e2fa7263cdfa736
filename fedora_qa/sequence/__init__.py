"""The file in canonical units: lazy, read-only, timestamps first, read through windows."""
