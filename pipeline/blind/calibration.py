"""What a zigzag crack along the edges of irregular triangles costs more than a straight one.

Measured on bars in tension (tests/blind/test_bar.py): with β = 1 the strength of a bar is 1.025 ± 0.005 times that of
its edges, and so is the energy of most cracks; edges carry the strength divided by it.
"""

from __future__ import annotations

TORTUOSITY = 1.025
