"""Pages: what was found, for people."""
