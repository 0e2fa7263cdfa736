"""Checks that everything stored can be read and is finite."""
