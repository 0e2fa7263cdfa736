"""The file in canonical units: lazy, read-only, stamps first, seen through windows."""
