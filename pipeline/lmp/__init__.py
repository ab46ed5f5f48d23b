"""The production engine: LAMMPS with a softening bond of our own."""
