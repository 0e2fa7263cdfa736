"""Where files lie: on this machine, or behind a URL, of which only what is asked for is read."""
