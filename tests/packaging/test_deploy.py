"""Files of `deploy/`: units, container and compose file name what exists, and a real Mosquitto starts with its file."""

from __future__ import annotations

import configparser
import os
import re
import shutil
import subprocess
import sys
import tarfile
import time
from pathlib import Path

import click
import pytest
import yaml
from live.local_broker import MOSQUITTO, WHY_NOT, free_port

from vsd_analytics.cli import cli
from vsd_analytics.doctor.broker import config_faults, parse_config

REPOSITORY = Path(__file__).resolve().parents[2]
COMMANDS = cli.list_commands(click.Context(cli))
DEPLOY = REPOSITORY / "deploy"
UNITS = sorted((DEPLOY / "systemd").glob("vsd-*"))
BACKUP = DEPLOY / "systemd" / "vsd-backup@.service"
FAILED = DEPLOY / "systemd" / "vsd-failed@.service"
SERVICES = [path for path in UNITS if path.suffix == ".service" and path not in (BACKUP, FAILED)]
"""Units that run a command of ours; the backup and the mail of failures run a script."""


def script_of(path: Path) -> str:
    """Return the script of a unit of the site `shop`, as its shell gets it."""
    text = path.read_text().replace("\\\n", "").replace("%i", "shop").replace("%%", "%").replace("$$", "$")
    script = re.search(r"ExecStart=\+?/bin/sh -ec '(.*)'", text)
    assert script is not None
    return script[1]


def program(path: Path, script: str) -> None:
    """Write a program that stands for one of the machine."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def unit(path: Path) -> configparser.ConfigParser:
    sections = configparser.ConfigParser(interpolation=None, strict=False)
    sections.optionxform = str  # type: ignore[assignment,method-assign]
    sections.read(path, encoding="utf-8")
    return sections


def commands(path: Path) -> list[list[str]]:
    """Return the commands of ours of a unit in their order, each as its words."""
    lines = [line.partition("=")[2] for line in path.read_text().splitlines() if line.startswith("ExecStart=")]
    return [line.split() for line in lines if not line.startswith("+/bin/sh")]


@pytest.mark.parametrize("path", SERVICES, ids=lambda p: p.name)
def test_a_unit_runs_a_command_that_exists_as_the_user_that_is_made(path: Path) -> None:
    service = unit(path)["Service"]
    for program, _, folder, name, *_ in commands(path):
        assert (program, folder) == ("/opt/vsd/bin/vsd", "/var/lib/vsd/%i")
        assert name in COMMANDS
    made = (DEPLOY / "systemd" / "sysusers.conf").read_text().splitlines()[-1].split()
    assert made[:2] == ["u", service["User"]]
    owners = {line.split()[1]: line.split()[3] for line in tmpfiles() if line.startswith("d ")}
    assert owners.items() >= {"/var/lib/vsd": service["User"], "/etc/vsd": "root"}.items()
    is_by_timer = path.with_suffix(".timer").is_file()
    if is_by_timer:  # a project that is gone fails where somebody looks, and no empty folder takes its place
        assert "StateDirectory" not in service
        assert service["ReadWritePaths"] == "-/var/lib/vsd/%i"
        assert "ConditionPathExists" not in unit(path)["Unit"]
    else:
        assert service["StateDirectory"].split()[0] == "vsd/%i"
        assert unit(path)["Unit"]["ConditionPathExists"] == "/var/lib/vsd/%i/vsd.toml"


def tmpfiles() -> list[str]:
    lines = (DEPLOY / "systemd" / "tmpfiles.conf").read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


def test_only_root_reads_copies_and_nothing_but_retention_days_says_how_long_they_stay(tmp_path: Path) -> None:
    made = {line.split()[1]: line.split() for line in tmpfiles()}
    copies = {folder: words for folder, words in made.items() if folder.startswith("/var/backups")}
    assert set(copies) == {"/var/backups/vsd", "/var/backups/vsd-keys"}
    assert all(words[2:] == ["0700", "root", "root"] for words in copies.values()), "no age"
    assert unit(BACKUP)["Service"]["UMask"] == "0077"


@pytest.mark.parametrize("days", [7, 30])
def test_copies_are_deleted_at_the_age_of_records(tmp_path: Path, days: int) -> None:
    now_s = time.time()
    for name, age_days in (("shop-2026-11-01", days), ("shop-2026-11-02", days - 1), ("shop-2-2026-11-01", days + 9)):
        for folder in ("vsd", "vsd-keys"):
            path = tmp_path / folder / f"{name}.tar.gz"
            path.parent.mkdir(exist_ok=True)
            path.touch()
            os.utime(path, (now_s, now_s - age_days * 86400 - 60))
    program(tmp_path / "bin" / "runuser", f'echo "retention_days = {days} days   (default)"')
    assert copies_left(tmp_path) == (0, ["shop-2-2026-11-01.tar.gz", "shop-2026-11-02.tar.gz"] * 2)
    program(tmp_path / "bin" / "runuser", "exit 2")
    code, left = copies_left(tmp_path)
    assert (code, len(left)) == (2, 4), "where the setting is not known, the unit fails and nothing is deleted"


def copies_left(tmp_path: Path) -> tuple[int, list[str]]:
    script = script_of(DEPLOY / "systemd" / "vsd-purge@.service").replace("/var/backups", str(tmp_path))
    environ = {"PATH": f"{tmp_path}/bin:/usr/bin:/bin"}
    done = subprocess.run(["/bin/sh", "-ec", script], env=environ, check=False)
    return done.returncode, [p.name for folder in ("vsd", "vsd-keys") for p in sorted((tmp_path / folder).iterdir())]


def test_the_copy_leaves_out_what_is_computed_again_and_keeps_keys_apart(tmp_path: Path) -> None:
    kept, left_out = ("vsd.toml", "store/a", "inbox/a", "sealed/a"), ("facts/a", "published/a", "inbox/done/b")
    for name in (*kept, *left_out, "secrets/a.key"):
        path = tmp_path / "lib" / "shop" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    for folder in ("vsd", "vsd-keys"):
        (tmp_path / folder).mkdir()
    calls = tmp_path / "calls"
    running = "vsd-watch@shop.service loaded active running\\nvsd-backup@shop.timer loaded active waiting\\n"
    said = f"""echo "$@" >> {calls}; case "$1" in list-units) printf '{running}';; esac"""
    program(tmp_path / "bin" / "systemctl", said)
    line = script_of(BACKUP).replace("/var/lib/vsd", str(tmp_path / "lib")).replace("/var/backups", str(tmp_path))
    done = subprocess.run(
        ["/bin/sh", "-ec", line],
        env={"PATH": f"{tmp_path}/bin:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert calls.read_text().splitlines()[1:] == ["stop vsd-watch@shop.service", "start vsd-watch@shop.service"]
    (copy,), (keys,) = (list((tmp_path / name).iterdir()) for name in ("vsd", "vsd-keys"))
    with tarfile.open(copy) as tar:
        files = {member.name for member in tar if member.isfile()}
    assert files == {f"shop/{name}" for name in kept}
    with tarfile.open(keys) as tar:
        assert [member.name for member in tar if member.isfile()] == ["shop/secrets/a.key"]


@pytest.mark.parametrize("path", [BACKUP, *SERVICES], ids=lambda p: p.name)
def test_a_unit_that_fails_is_mailed(path: Path) -> None:
    assert unit(path)["Unit"]["OnFailure"] == FAILED.name.replace("@", "@%i")


def run_failed(tmp_path: Path, failing: str) -> tuple[int, Path]:
    """Run the script of vsd-failed@shop where some units failed; return its exit code and what `vsd` was given."""
    mailed = tmp_path / "mailed"
    program(tmp_path / "bin" / "systemctl", f"case \"$*\" in *--state=failed*) printf '{failing}';; esac")
    program(
        tmp_path / "bin" / "journalctl",
        'for one; do case "$one" in --unit=*) echo "lines of ${one#--unit=}";; esac; done',
    )
    program(tmp_path / "bin" / "vsd", f'{{ echo "$@"; cat; }} > {mailed}')
    done = subprocess.run(
        ["/bin/sh", "-ec", script_of(FAILED).replace("/opt/vsd/bin/vsd", "vsd")],
        env={"PATH": f"{tmp_path}/bin:/usr/bin:/bin"},
        check=False,
    )
    return done.returncode, mailed


def test_the_mail_names_each_unit_that_failed_and_has_its_lines(tmp_path: Path) -> None:
    failing = "".join(f"vsd-{name}@shop.service loaded failed failed vsd\\n" for name in ("failed", "purge", "report"))
    code, mailed = run_failed(tmp_path, failing)
    assert code == 0
    assert mailed.read_text().splitlines() == [
        "-C /var/lib/vsd/shop failed vsd-purge@shop.service vsd-report@shop.service",
        "lines of vsd-purge@shop.service",
        "lines of vsd-report@shop.service",
    ]


def test_a_unit_that_is_about_to_start_again_is_not_mailed(tmp_path: Path) -> None:
    code, mailed = run_failed(tmp_path, "")
    assert (code, mailed.exists()) == (0, False)


def test_the_index_finds_the_file_that_the_report_of_the_same_unit_writes() -> None:
    report, index = commands(DEPLOY / "systemd" / "vsd-report@.service")
    assert index[3:5] == ["site", "build"]
    assert "json" in report[report.index("--format") + 1].split(",")
    assert report[-1] == "$VSD_REPORT"  # the options of a site: empty, they are no word at all


@pytest.mark.parametrize("path", SERVICES, ids=lambda p: p.name)
def test_options_of_a_site_are_empty_unless_it_gives_some(path: Path) -> None:
    text = path.read_text()
    for name in re.findall(r"\$(VSD_\w+)$", text, re.MULTILINE):
        assert f"\nEnvironment={name}=\n" in text.partition("EnvironmentFile")[0], "systemd warns of unset ones"


@pytest.mark.parametrize("path", SERVICES, ids=lambda p: p.name)
def test_options_of_a_unit_are_options_of_its_command(path: Path) -> None:
    for _, _, _, *words in commands(path):
        given = [word.replace("%i", "shop") for word in words if not word.startswith("$")]
        command: click.Command = cli
        while isinstance(command, click.Group):
            name, given = given[0], given[1:]
            inner = command.get_command(click.Context(command), name)
            assert inner is not None, name
            command = inner
        command.make_parser(click.Context(command)).parse_args(given)


def test_each_timer_starts_a_unit_and_the_page_on_timers_names_every_unit() -> None:
    page = (REPOSITORY / "docs" / "timers.md").read_text(encoding="utf-8")
    for path in UNITS:
        assert path.suffix != ".timer" or path.with_suffix(".service").is_file()
        is_started_by_timer = path.with_suffix(".timer").is_file()
        assert path.name.replace("@", "@SITE").replace(".service", "") in page or is_started_by_timer, path.name


def test_a_listener_that_another_one_replaced_is_not_started_again() -> None:
    assert unit(DEPLOY / "systemd" / "vsd-listen@.service")["Service"]["RestartPreventExitStatus"] == "2"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not here")
def test_systemd_understands_the_units(tmp_path: Path) -> None:
    for path in UNITS:
        text = path.read_text().replace("/opt/vsd/bin/vsd", sys.executable)
        (tmp_path / path.name).write_text(text)
    command = ["systemd-analyze", "verify", "--man=no", *(str(tmp_path / p.name.replace("@", "@shop")) for p in UNITS)]
    for path in UNITS:
        (tmp_path / path.name.replace("@", "@shop")).write_text((tmp_path / path.name).read_text())
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    ours = [line for line in done.stderr.splitlines() if "vsd-" in line]
    assert ours == [], done.stderr


def test_the_image_copies_what_exists_and_installs_what_the_core_needs() -> None:
    lines = (DEPLOY / "Containerfile").read_text().splitlines()
    for line in lines:
        if line.startswith("COPY "):
            for source in line.split()[1:-1]:
                assert (REPOSITORY / source).exists(), source
    assert any("core-requirements.txt" in line and "--no-deps" in line for line in lines)
    user = next(line for line in lines if line.startswith("USER"))
    assert user == "USER 10001"  # a number: a host without this user can check that it is not root
    assert 'ENTRYPOINT ["vsd"]' in lines


def test_compose_names_files_that_exist_and_opens_no_port_to_other_machines() -> None:
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
    broker, listener = compose["services"]["broker"], compose["services"]["listener"]
    assert all(str(port).startswith("127.0.0.1:") for port in broker["ports"])
    assert (DEPLOY / broker["volumes"][0].partition(":")[0]).is_file()
    assert (DEPLOY / listener["build"]["context"] / listener["build"]["dockerfile"]).is_file()
    assert listener["command"][0] in COMMANDS
    assert "broker" in listener["depends_on"]
    assert {v.partition(":")[0] for v in broker["volumes"][1:]} == set(compose["volumes"])


@pytest.mark.skipif(MOSQUITTO is None, reason=WHY_NOT)
def test_mosquitto_starts_with_the_file_of_compose(tmp_path: Path) -> None:
    text = (DEPLOY / "mosquitto.conf").read_text()
    assert config_faults(parse_config(DEPLOY / "mosquitto.conf")) == []
    assert not re.search(r"^listener 1883 127", text, re.MULTILINE), "another container could not reach it"
    own = text.replace("/mosquitto/data/", f"{tmp_path}/").replace("listener 1883", f"listener {free_port()} 127.0.0.1")
    (tmp_path / "mosquitto.conf").write_text(own)
    assert MOSQUITTO is not None
    process = subprocess.Popen([MOSQUITTO, "-c", str(tmp_path / "mosquitto.conf")], stderr=subprocess.PIPE, text=True)
    try:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(1.5)
    finally:
        process.terminate()
        process.wait(10)


def test_requirements_of_the_page_are_those_of_the_file() -> None:
    page = (REPOSITORY / "docs" / "install.md").read_text()
    assert "deploy/core-requirements.txt" in page
    for name in re.findall(r"deploy/[\w./@-]+", page):
        found = name.rstrip(".")
        assert (REPOSITORY / found).exists() or found == "deploy/project" or found.startswith("deploy/project/"), found
