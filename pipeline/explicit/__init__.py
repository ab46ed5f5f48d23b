"""What explicit engines share: masses, the lowest mode, and how fast to load."""
