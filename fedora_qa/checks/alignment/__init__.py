"""Whether the cameras look at the same thing from where they are declared to be."""
