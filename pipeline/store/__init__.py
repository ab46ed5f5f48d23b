"""The door: experiment bundles, images, displacement fields, simulations and results on disk."""
