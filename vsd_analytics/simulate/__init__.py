"""The seeded simulator behind `vsd demo` and most tests: a made-up shop, its engine output and its truth.

Importing this package loads numpy and pyarrow; the command line imports it inside the commands that need it.
"""

from vsd_analytics.simulate.canteen_project import write_canteen_project
from vsd_analytics.simulate.demo_project import simulate_week, write_demo_project
from vsd_analytics.simulate.frame_messages import write_messages
from vsd_analytics.simulate.people import SimulatedDay, simulate_day
from vsd_analytics.simulate.truth import DemoTruth, violations

__all__ = [
    "DemoTruth",
    "SimulatedDay",
    "simulate_day",
    "simulate_week",
    "violations",
    "write_canteen_project",
    "write_demo_project",
    "write_messages",
]
