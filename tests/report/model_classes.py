"""All classes of the report model under one name, for tests that make reports by hand."""

from vsd_analytics.figures.week.model_estimate import *  # noqa: F403
from vsd_analytics.figures.week.model_map import *  # noqa: F403
from vsd_analytics.figures.week.model_recording import *  # noqa: F403
from vsd_analytics.figures.week.model_sections import *  # noqa: F403
from vsd_analytics.figures.week.results import *  # noqa: F403
