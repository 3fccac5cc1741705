"""The list of licences: what each package states, and which state none."""

from __future__ import annotations

from licence_list import licence_table


def test_each_package_has_a_row_and_a_missing_licence_is_said() -> None:
    classifier = "License :: OSI Approved :: BSD License"
    sbom = {
        "components": [
            {"name": "tqdm", "version": "4.70", "licenses": [{"expression": "MPL-2.0 AND MIT"}]},
            {"name": "babel", "version": "2.18", "licenses": [{"license": {"name": classifier}}]},
            {"name": "duckdb", "version": "2.0", "licenses": [{"license": {"id": "MIT"}}, {"license": {"id": "MIT"}}]},
            {"name": "resvg_py", "version": "0.5"},
        ]
    }
    assert licence_table(sbom).splitlines()[2:] == [
        "| babel | 2.18 | BSD License |",
        "| duckdb | 2.0 | MIT |",
        "| resvg_py | 0.5 | not stated |",
        "| tqdm | 4.70 | MPL-2.0 AND MIT |",
    ]
