"""Which group holds, how sure, and what else it could be: the only place with a threshold."""
