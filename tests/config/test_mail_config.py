"""`[mail]`, `[report] base_url` and `chromium` of vsd.toml: read, or refused with line and fix."""

from __future__ import annotations

from pathlib import Path

import pytest
from report import ingested_worlds as w

from vsd_analytics.config.project import load_site
from vsd_analytics.config.routes import is_address
from vsd_analytics.errors import ConfigError, VsdError
from vsd_analytics.site.model import Site

GOOD = """
[mail]
smtp = "mail.example.org"
from = "reports@example.org"
to = ["manager@example.org", "analyst@example.org", "manager@example.org"]
"""


def load(folder: Path, more: str) -> Site:
    (folder / "vsd.toml").write_text(w.toml(more=more), encoding="utf-8")
    return load_site(folder)


def mistakes(folder: Path, more: str) -> list[VsdError]:
    with pytest.raises(ConfigError) as caught:
        load(folder, more)
    return list(caught.value.problems)


@pytest.mark.parametrize(
    ("tls", "port"), [("", 587), ('tls = "tls"', 465), ('tls = "none"', 25), ("port = 2525", 2525)]
)
def test_a_server_with_defaults(tmp_path: Path, tls: str, port: int) -> None:
    route = load(tmp_path, GOOD + tls).mail
    assert route is not None
    assert (route.smtp, route.port, route.sendmail) == ("mail.example.org", port, None)
    assert route.to == ("manager@example.org", "analyst@example.org")
    assert route.tls == (tls.split('"')[1] if "tls" in tls else "starttls")


def test_no_table_no_mail(tmp_path: Path) -> None:
    site = load(tmp_path, "")
    assert (site.mail, site.base_url, site.chromium) == (None, None, None)


def test_a_mail_program_in_place_of_a_server(tmp_path: Path) -> None:
    route = load(tmp_path, '[mail]\nsendmail = "/usr/sbin/sendmail"\nfrom = "a@example.org"').mail
    assert route is not None
    assert route.sendmail == Path("/usr/sbin/sendmail")


def test_a_password_file_outside_the_project(tmp_path: Path) -> None:
    folder = tmp_path / "project"
    folder.mkdir()
    route = load(folder, GOOD + f'user = "vsd"\npassword_file = "{tmp_path}/secret"').mail
    assert route is not None
    assert route.password_file == tmp_path / "secret"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (GOOD + 'password = "hunter2"', "does not belong in vsd.toml"),
        (GOOD + 'user = "vsd"\ntls = "none"', "for everyone to read"),
        (GOOD + 'tls = "ssl"', "is not one of"),
        (GOOD + "port = 70000", "outside"),
        (GOOD + 'sendmail = "/usr/sbin/sendmail"', "both smtp and sendmail"),
        (GOOD + 'password_file = "secrets/mail"', "outside the project"),
        (GOOD + 'recipients = ["a@example.org"]', "knows no key"),
        ('[mail]\nfrom = "a@example.org"', "has no smtp"),
        ('[mail]\nsmtp = "x"', "has no from"),
        ('[mail]\nsendmail = "sendmail"\nfrom = "a@example.org"', "no whole path"),
        (GOOD.replace("manager@", "manager at "), "no mail address"),
        (
            GOOD.replace('"reports@', '"Shop <reports@').replace('example.org"\nto', 'example.org>"\nto'),
            "no mail address",
        ),
        (GOOD.replace('"manager@example.org", ', '"a@b.org\\r\\nBcc: c@d.org", '), "no mail address"),
        ('[report]\nbase_url = "intranet/reports"', "no http or https address"),
        ('[report]\nbase_url = "https://x.example/?q=1"', "no http or https address"),
        ('[report]\nbase_url = "javascript:alert(1)"', "no http or https address"),
    ],
)
def test_what_cannot_be_is_refused_with_its_line(tmp_path: Path, more: str, said: str) -> None:
    found = mistakes(tmp_path, more)
    assert any(said in p.what for p in found), [p.what for p in found]
    for problem in found:
        assert problem.where is not None
        assert problem.where.line
        assert problem.fix
        assert "hunter2" not in problem.what + (problem.fix or "") + (problem.where.text or "")


def test_a_project_inside_a_folder_of_secrets_may_not_hide_one_by_dots(tmp_path: Path) -> None:
    [problem] = mistakes(tmp_path, GOOD + f'password_file = "{tmp_path}/plans/../secret"')
    assert "outside the project" in problem.what


def test_where_reports_are_read_and_what_prints_them(tmp_path: Path) -> None:
    site = load(tmp_path, '[report]\nbase_url = "https://intranet.example.org/distancing/"\nchromium = "/opt/chrome"')
    assert site.base_url == "https://intranet.example.org/distancing"
    assert site.chromium == Path("/opt/chrome")


@pytest.mark.parametrize("text", ["a@b", "first.last+vsd@mail.example.org", "x@example-site.org"])
def test_an_address(text: str) -> None:
    assert is_address(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "@b",
        "a@",
        "a@b@c",
        "a b@c",
        "a@b\n",
        "a@b\r\nBcc: x@y",
        "a..b@c",
        ".a@b",
        "<a@b>",
        "a@-b",
        "ä@b",
        "a@b,c@d",
    ],
)
def test_no_address(text: str) -> None:
    assert not is_address(text)
