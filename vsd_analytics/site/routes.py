"""Where a project sends things, the weekly mail and the records of a node, and where pictures of cameras come from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, slots=True)
class ExchangeRoute:
    """Where nodes hand on what they acknowledged, and the store of the site receives it.

    Attributes:
        place: Absolute path of a folder, or `s3://BUCKET/FOLDER`.
        node: Name of this node, which hands on; None = this project is the site's store, which receives.
    """

    place: str
    node: str | None = None


MailTls = Literal["starttls", "tls", "none"]


@dataclass(frozen=True, slots=True)
class MailRoute:
    """How the weekly mail is sent: by an SMTP server, or by a mail program of this machine.

    Attributes:
        sender: Address it comes from.
        to: Addresses it goes to.
        failures_to: Addresses that hear of a unit that failed; empty = `to`.
        smtp: Name or address of the server; None = `sendmail`.
        port: TCP port of the server.
        tls: "starttls" (encrypted before anything is said), "tls" (from the first byte), "none" (no login then).
        user: None = no login; the password is never in vsd.toml: see `password_file`.
        password_file: File outside the project with the password on its first line; the environment's
            VSD_MAIL_PASSWORD wins.
        ca_file: Certificates to trust; None = the system's.
        sendmail: Program that takes a mail on its standard input; None = `smtp`.
    """

    sender: str
    to: tuple[str, ...] = ()
    failures_to: tuple[str, ...] = ()
    smtp: str | None = None
    port: int = 587
    tls: MailTls = "starttls"
    user: str | None = None
    password_file: Path | None = None
    ca_file: Path | None = None
    sendmail: Path | None = None


@dataclass(frozen=True, slots=True)
class CameraSource:
    """Where the pictures of a camera come from.

    Attributes:
        address: An address of RTSP or HTTP, a device such as `/dev/video0`, or the path of a video, shown in a loop.
            It has no password; `{password}` in it is replaced by one.
        username: User of the login; None = there is no login.
        password_file: File with the password on its first line; the environment's VSD_SOURCE_PASSWORD_ID wins.
    """

    address: str
    username: str | None = None
    password_file: Path | None = None

    @property
    def is_network(self) -> bool:
        """Return whether the pictures come over a network."""
        return "://" in self.address
