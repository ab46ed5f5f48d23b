"""Simulate the measured concrete beam with published properties, identify it from load–CMOD, print both tables.

usage: python scripts/validate_beam.py DATA OUT       (DATA: folder of the measured data)
"""

import sys
from pathlib import Path

from pipeline.study.concrete_beam import beam_identification, beam_table

if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    data, out = map(Path, sys.argv[1:])
    print(beam_table(data, out))
    print(beam_identification(data, out))
