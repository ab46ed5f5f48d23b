"""Engine C: triangles with cohesive edges, for the blind check only; shares no law, mesh or solver with the others."""
