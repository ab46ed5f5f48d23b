"""Cohesive fracture properties of bonded-particle specimens from images of a fracture test."""

__version__ = "0.1.0"
