"""Studies that run on a cluster without Python: exported folders, their manifest, and reading them back."""
