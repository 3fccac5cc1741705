"""Tests of the analysis make their projects with the helpers of the tests of the warehouse and the statistics."""

import sys
from pathlib import Path

for room in ("warehouse", "stats"):
    sys.path.append(str(Path(__file__).resolve().parent.parent / room))
