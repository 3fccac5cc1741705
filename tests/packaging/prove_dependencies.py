"""Runs tests on the lowest allowed versions of all dependencies, and on newer Pythons with the newest versions.

    python tests/packaging/prove_dependencies.py [--python 3.11 ...] [tests ...]

Needs `uv` (PyPI) and the interpreters, of pyenv or on the path; one that is not here is named and left out. Each
environment is made anew in a temporary folder. Prints a row for each, for docs/upgrade.md.
The lowest versions are those of pyproject.toml
(dependencies, and the extras polars, serve and xlsx); what the tests need beside them is the newest.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import tempfile
import tomllib
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
EXTRAS = ".[polars,serve,xlsx]"
TOOLS = (
    "pytest",
    "hypothesis",
    "jsonschema",
    "networkx",
    "httpx",
    "nbformat",
    "nbclient",
    "ipykernel",
    "pyyaml",
    "griffe",
)
CORE_SUITE = (
    "tests/warehouse/test_accelerated_against_sql.py",
    "tests/store",
    "tests/config",
    "tests/sql/test_sql_cases.py",
)
ENVIRONMENTS = (("3.11", "lowest-direct"), ("3.11", "highest"), ("3.12", "highest"), ("3.13", "highest"))


def find(python: str) -> Path | None:
    """Return an interpreter of a version: one that pyenv holds, or the one of the path."""
    held = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    candidates = [*(p / "bin" / "python" for p in sorted(held.glob(f"{python}.*"))), shutil.which(f"python{python}")]
    for candidate in candidates:
        asked = "import sys; print('%d.%d' % sys.version_info[:2])"
        if candidate is not None:
            told = subprocess.run([candidate, "-c", asked], capture_output=True, text=True, check=False).stdout
            if told.strip() == python:
                return Path(candidate)
    return None


def make(folder: Path, *, python: str, resolution: str) -> Path | None:
    """Return the interpreter of an environment with the program in it, or None where there is no such Python."""
    uv = shutil.which("uv")
    if uv is None:
        raise SystemExit("uv is not here: pip install uv")
    interpreter = find(python)
    if interpreter is None:
        return None
    subprocess.run([uv, "venv", "--quiet", "--python", interpreter, folder], check=True)
    inside = folder / "bin" / "python"
    install = [uv, "pip", "install", "--quiet", "--python", inside]
    subprocess.run([*install, "--resolution", resolution, "--editable", EXTRAS], check=True, cwd=REPOSITORY)
    subprocess.run([*install, *TOOLS], check=True, cwd=REPOSITORY)
    return inside


def versions(python: Path) -> dict[str, str]:
    """Return the installed version of each direct dependency."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *extras["polars"], *extras["serve"], *extras["xlsx"]]
    names = [match[0] for line in wanted if (match := re.match(r"[\w-]+", line))]
    script = f"import importlib.metadata as m\nfor n in {names!r}: print(n, m.version(n))"
    printed = subprocess.run([python, "-c", script], capture_output=True, text=True, check=True).stdout
    return dict(line.split() for line in printed.splitlines())


def main() -> None:
    """Make the environments, run the tests in each and print what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", action="append", help="only these, such as 3.13")
    parser.add_argument("--resolution", choices=("lowest-direct", "highest"))
    parser.add_argument("tests", nargs="*", default=CORE_SUITE)
    asked = parser.parse_args()
    print("| Python | versions | tests | pandas | numpy | pyarrow | duckdb |\n|---|---|---|---|---|---|---|")
    failed = False
    for python, resolution in ENVIRONMENTS:
        if (asked.python and python not in asked.python) or (asked.resolution and resolution != asked.resolution):
            continue
        with tempfile.TemporaryDirectory(prefix="vsd-environment-") as folder:
            inside = make(Path(folder) / "env", python=python, resolution=resolution)
            if inside is None:
                print(f"| {python} | not on this machine | | | | | |")
                continue
            environ = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
            command = [inside, "-m", "pytest", "-q", "-p", "no:cacheprovider", *asked.tests]
            done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=REPOSITORY, env=environ)
            failed |= done.returncode != 0
            if done.returncode:
                print(done.stdout[-6000:], done.stderr[-2000:])
            has = versions(inside)
            said = (done.stdout.strip().splitlines() or ["nothing"])[-1].strip("= ")
            shown = " | ".join(has[name] for name in ("pandas", "numpy", "pyarrow", "duckdb"))
            print(
                f"| {python} | {'lowest' if resolution == 'lowest-direct' else 'newest'} | {said} | {shown} |",
                flush=True,
            )
    raise SystemExit(failed)


if __name__ == "__main__":
    main()
