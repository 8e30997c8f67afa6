"""A data set labelled: what was found in each object, what a person decided of it, and what follows from both."""
