"""Recordings with true groups are read and scored by the helpers of the statistics' proofs."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "stats"))
