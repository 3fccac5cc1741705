"""Writes the public names with their signatures as a stub, which a later version is compared with.

`python tests/api/public_contract.py` replaces the stub of the last release: run it when a version is released, never to
silence the test.
"""

from __future__ import annotations

from pathlib import Path

import griffe

HERE = Path(__file__).resolve().parent
RELEASED = HERE / "released_api.txt"


def package() -> griffe.Module:
    """Return what the source says of the package, with the imports of `TYPE_CHECKING` followed."""
    found = griffe.load("vsd_analytics", search_paths=[HERE.parents[1]], resolve_aliases=True)
    assert isinstance(found, griffe.Module)
    return found


def stub(package: griffe.Module) -> str:
    """Return functions, classes and their public methods and properties, without bodies.

    Constructors are left out: objects come from `vsd.open` and from each other.
    """
    lines = ["# Made by tests/api/public_contract.py: the public API of the last release."]
    for name in sorted(public_names(package)):
        thing = package[name].final_target
        if thing.is_function:
            lines += ["", f"def {thing.signature(name=name)}: ..."]
        elif thing.is_class:
            members = [line for member in thing.members.values() for line in _member(member)]
            lines += ["", f"class {name}:", *(members or ["    ..."])]
    return "\n".join(lines) + "\n"


def public_names(package: griffe.Module) -> list[str]:
    """Return the names of `__all__`, but for the version."""
    return [str(name) for name in package.exports or () if not str(name).startswith("__")]


def _member(member: griffe.Object | griffe.Alias) -> list[str]:
    if member.name.startswith("_") or member.is_alias:
        return []
    if member.is_function:
        return [f"    def {member.signature()}: ..."]
    if member.is_attribute and member.annotation is not None:
        return [f"    {member.name}: {member.annotation}"]
    return []


if __name__ == "__main__":
    RELEASED.write_text(stub(package()), encoding="utf-8")
