"""Whom we are compared with: thin adapters to published packages, a module each."""
