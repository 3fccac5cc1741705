"""`[engine]` of vsd.toml: how good the engine is, by the site's own account."""

from __future__ import annotations

from pathlib import Path

import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.site.model import EngineError

SITE = '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n[[camera]]\nid = "cam"\nname = "Cam"\n'


def stated(root: Path, text: str) -> EngineError | None:
    (root / "vsd.toml").write_text(SITE + text)
    return load_site(root).engine


def test_each_is_known_or_not(tmp_path: Path) -> None:
    assert stated(tmp_path, "") is None
    assert stated(tmp_path, "[engine]\n") is None
    assert stated(tmp_path, "[engine]\nprecision = 0.9\n") == EngineError(precision=0.9)
    text = "[engine]\nprecision = 1\nrecall = 0.85\ndistance_sd_m = 0.15\n"
    assert stated(tmp_path, text) == EngineError(1, 0.85, 0.15)


@pytest.mark.parametrize("wrong", ["precision = 0", "recall = 1.2", 'recall = "90 %"', "distance_sd_m = -0.1"])
def test_impossible_values_are_refused_with_the_line(tmp_path: Path, wrong: str) -> None:
    with pytest.raises(ConfigError) as caught:
        stated(tmp_path, f"[engine]\n{wrong}\n")
    (problem,) = caught.value.problems
    assert problem.where is not None
    assert problem.where.line == SITE.count("\n") + 2
    assert wrong.split(maxsplit=1)[0] in problem.what


def test_unknown_key_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        stated(tmp_path, "[engine]\nprecison = 0.9\n")
