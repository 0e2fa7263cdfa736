"""The reference generator: FEDORA-format sequences whose truth is known."""
