"""From the picture of a cut face to particles and bonds: segmentation, packing, phases, grips."""
