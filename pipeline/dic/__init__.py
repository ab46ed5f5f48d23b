"""Digital image correlation with subset splitting: crack paths are found, never given."""
