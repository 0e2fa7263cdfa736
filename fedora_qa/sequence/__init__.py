"""Access to a file in canonical units: lazy, read-only, timestamps first, by windows."""
