"""Specimens and data shared by tests."""
