"""The smallest `vsd.toml` that works, for tests that are about something else."""

from __future__ import annotations

NAMES = {"cam-1": "Entrance", "cam-2": "Exit"}


def site_text(*camera_ids: str, site: str = "", more: str = "", timezone: str = "Europe/Rome") -> str:
    """Return a shop of one floor.

    Args:
        camera_ids: Its cameras; none = cam-1.
        site: More lines of `[site]`.
        more: Lines after the last camera: of its own, then of other tables.
        timezone: IANA zone.
    """
    cameras = "".join(f'[[camera]]\nid = "{c}"\nname = "{NAMES.get(c, c)}"\n' for c in camera_ids or ("cam-1",))
    head = f'[site]\nid = "shop"\nname = "Riverside Store"\ntimezone = "{timezone}"\n{site}'
    return f'{head}[[floor]]\nid = "ground"\nname = "Ground floor"\n{cameras}{more}'
