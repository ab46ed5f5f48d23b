"""What a finished command shows: figures and one self-contained page."""

from __future__ import annotations


def simulation_page(*a): ...
def identification_page(*a): ...
