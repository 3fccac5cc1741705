"""Imported by the server that forks, so that a child need not: all modules, the SQL files and the templates."""

import importlib
import pkgutil

import jobs  # noqa: F401
import project_state  # noqa: F401
import tqdm

import vsd_analytics
from vsd_analytics.report.pages.templates import environment
from vsd_analytics.warehouse.sqlfiles import relations

NOT_IN_JOBS = ("vsd_analytics.cluster",)
"""Rooms whose libraries may be missing. The server stops importing without a word where an import fails."""
LIBRARIES = ("contourpy", "cv2", "duckdb", "pandas", "pyarrow.dataset", "scipy.sparse.csgraph", "shapely")
for name in ("pyarrow.pandas_compat", "pyarrow.parquet", "pyarrow.vendored.version", *LIBRARIES):
    importlib.import_module(name)
for module in pkgutil.walk_packages(vsd_analytics.__path__, "vsd_analytics."):
    if not module.name.startswith(NOT_IN_JOBS):
        importlib.import_module(module.name)
tqdm.tqdm.get_lock()  # one for all children: nothing is left over of those that are killed
for layers in (("staging",), ("facts",), ("marts",), ("staging", "facts"), ("facts", "marts")):
    relations(*layers)
for template in environment().list_templates(filter_func=lambda name: name.endswith(".j2") and "mail" not in name):
    environment().get_template(template)
