"""Faults as views of a sequence: rows altered as they are read; canaries plant them."""
