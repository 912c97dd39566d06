"""One file a command; each parses, calls, renders and exits."""
