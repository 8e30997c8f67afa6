"""Where to look: evidence that is weighed, never obeyed."""
