"""Engine B: virtual fracture tests on an irregular network that shares nothing with the identifying lattice."""
