"""The rates of flow against each other."""
