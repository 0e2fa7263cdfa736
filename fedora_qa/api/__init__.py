"""The package as a library: check files, look at what was found as data frames, and see it in a notebook."""
