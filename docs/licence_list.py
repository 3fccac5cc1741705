"""Prints the licences of a bill of materials (CycloneDX JSON) as a table: `make sbom` writes both files."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, Final

NOT_STATED: Final = "not stated"


def licence_of(component: dict[str, Any]) -> str:
    """Return the licence that a package states: an SPDX expression if there is one, else what it says in words."""
    stated = component.get("licenses", [])
    expressions = [s["expression"] for s in stated if "expression" in s]
    names = [s["license"].get("id") or s["license"].get("name", "") for s in stated if "license" in s]
    found = expressions or list(dict.fromkeys(n.rpartition(" :: ")[2] for n in names if n))
    return ", ".join(found) or NOT_STATED


def licence_table(sbom: dict[str, Any]) -> str:
    """Return a Markdown table of package, version and licence, by name."""
    rows = sorted((c["name"], c["version"], licence_of(c)) for c in sbom["components"])
    lines = ["| package | version | licence |", "|---|---|---|", *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(licence_table(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))))
