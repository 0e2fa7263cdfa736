"""Run the checks over a file: stamps first, fixed windows, one measuring pass, one bounded second look."""
