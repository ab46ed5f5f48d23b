"""Quasi-static engine: the sequence of equilibria that an explicit run reaches when driven slowly enough."""
