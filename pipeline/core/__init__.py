"""The ground floor: what a specimen, a problem and a solution are. NumPy only."""
