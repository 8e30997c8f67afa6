"""Poses of a symmetric body: the equivalent one that is nearest, how far two are apart, and the mean of many."""
