"""The event stream by itself."""
