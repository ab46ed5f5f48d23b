"""The step-by-step definition of the explicit solution, in NumPy: what LAMMPS must do, and slower."""
