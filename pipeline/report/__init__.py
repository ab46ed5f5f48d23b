"""Figures (data in, axes out) and the self-contained page."""
