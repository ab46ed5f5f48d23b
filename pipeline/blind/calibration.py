"""What a zigzag crack along the edges of irregular triangles costs more than a straight one.

Edges carry the strength and the energy divided by these. Strength: of bars in tension, 0.968 ± 0.003 over ten meshes of
3 and 2 mm (`tests/blind/test_bar.py`). Energy: of beams without stones against the same beam with a row of edges on its
notch line (`scripts/blind_engine.py`). Both at `SLIDING`; with β = 1 the strength would be 1.025 ± 0.005.
"""

from __future__ import annotations

import numpy as np

STRENGTH, ENERGY = 0.968, 1.05
SLIDING = float(1 / np.sqrt(3))
"""Strength in sliding over that in opening of a row of bonds of central forces, without pressure across it.

Of the two bonds per 2 r, inclined by ±30° to the normal, one is stretched to f_max while the other is pushed as hard:
f_max/(2 r t) along the row, against √3 f_max/(2 r t) in opening.
"""
