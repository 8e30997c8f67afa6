"""The denoised surface, and how an operation misses it."""
