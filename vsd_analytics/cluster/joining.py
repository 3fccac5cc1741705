"""How a node gets the secret of its site: once, by a file that somebody carries.

The file gives the keys of the days that the site has not forgotten, and of all days to come. It is as secret as the
folder `secrets` itself: whoever has it can find out which pseudonym belongs to which track id of the engine.
"""

from __future__ import annotations

from datetime import date

import msgspec

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.site.model import Site
from vsd_analytics.store.day_chain import DayChain
from vsd_analytics.store.secrets import KEY_BYTES, DayKeys


class Invitation(msgspec.Struct, frozen=True, kw_only=True):
    """What a node needs to name tracks as its site does.

    Attributes:
        version: Of this form.
        site: Id of the site.
        timezone: IANA zone that its days are in.
        day_starts_min: Minutes after local midnight at which a site day starts.
        chain: First day and state of its secret (`store.day_chain`).
        keys: Keys of days that have one of their own, hexadecimal.
        forgotten: Days whose keys were destroyed.
    """

    version: int
    site: str
    timezone: str
    day_starts_min: int
    chain: dict[str, str]
    keys: dict[date, str]
    forgotten: list[date]


def invitation(site: Site) -> bytes:
    """Return the file that lets a node join a site; the site gets a secret where it has none.

    Raises:
        StoreError: E303, a key is damaged; DiskError: the disk refused.
    """
    keys = DayKeys(site.root / "secrets")
    chain = keys.chain()
    new = Invitation(
        version=1,
        site=site.site_id,
        timezone=site.timezone,
        day_starts_min=site.day_starts_min,
        chain=chain.as_dict(),
        keys={day: keys.key(day).hex() for day in keys.days()},
        forgotten=sorted(keys.forgotten()),
    )
    return msgspec.json.encode(new)


def join(site: Site, data: bytes, *, file: str) -> None:
    """Take over the secret of a site.

    Args:
        site: The project of the node.
        data: The content of the file.
        file: Its name, for messages.

    Raises:
        StoreError: E320, it is no such file, of another site, or the project has other keys already.
    """
    try:
        invited = msgspec.json.decode(data, type=Invitation)
        chain = DayChain.of_dict(invited.chain)
        keys = {day: bytes.fromhex(key) for day, key in invited.keys.items()}
        if any(len(key) != KEY_BYTES for key in keys.values()):
            raise ValueError(f"a key has {KEY_BYTES} bytes")
    except (msgspec.DecodeError, UnicodeDecodeError, ValueError, KeyError, RecursionError):
        raise _refused("it is not what vsd node invite writes", file) from None
    this_site = {"id": site.site_id, "timezone": site.timezone, "day_starts": site.day_starts_min}
    theirs = {"id": invited.site, "timezone": invited.timezone, "day_starts": invited.day_starts_min}
    if other := [name for name, value in this_site.items() if theirs[name] != value]:
        raise _refused(f"vsd.toml differs from that of the site in: {', '.join(other)}", file)
    DayKeys(site.root / "secrets").join(chain, keys, invited.forgotten)


def _refused(why: str, file: str) -> StoreError:
    return StoreError(
        "this file does not let the project join a site",
        code="E320",
        where=Where(file),
        why=why,
        fix="copy vsd.toml of the site, add node = ... under [exchange], then use the file of vsd node invite",
    )
