"""Beside the product: objects with known symmetry, studies that measure on them, the baseline and the peers."""
