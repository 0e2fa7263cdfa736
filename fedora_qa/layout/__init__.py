"""The file as data: what the canonical layout holds, where a given file keeps it, and in which dialect."""
