"""Engine C of the blind check against a straight crack, against the lattice, and as its edges get shorter.

python scripts/blind_engine.py                  a beam without stones
python scripts/blind_engine.py --stones         the graded section
python scripts/blind_engine.py --edges 2 --meshes 0,1,2 --shear 1
"""

from __future__ import annotations

import argparse

from pipeline.study.blind_check.engine_c import rows


def numbers(text: str) -> list[float]:
    return [float(part) for part in text.split(",") if part]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, help="of section and truth, as of blind-check make")
    parser.add_argument("--stones", action="store_true")
    parser.add_argument("--radii", type=numbers, default=[1.5, 1.0, 0.75], help="of the lattice, mm")
    parser.add_argument("--edges", type=numbers, default=[2.0, 1.5, 1.0], help="of the triangles, mm")
    parser.add_argument("--meshes", type=numbers, default=[0.0, 1.0])
    parser.add_argument("--shear", type=float, default=None, help="strength in sliding over that in opening")
    given = parser.parse_args()
    meshes = [int(m) for m in given.meshes]
    for line in rows(given.seed, given.stones, given.radii, given.edges, meshes, given.shear):
        print(line, flush=True)


if __name__ == "__main__":
    main()
