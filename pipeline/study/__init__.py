"""The order of things: one file a command, its stages from files in to files out."""
