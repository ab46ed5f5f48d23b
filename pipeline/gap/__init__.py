"""What a model leaves out: where simulation and test part, which effect explains it, how far it closes the gap."""
