"""`vsd --help` and `vsd help`: seven commands for a week, every other one under its job."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from vsd_analytics.cli import COMMANDS, JOBS, cli
from vsd_analytics.cli.exit_codes import run


def said(*arguments: str) -> str:
    done = CliRunner().invoke(cli, list(arguments))
    assert done.exit_code == 0, done.output
    return done.output


def test_every_command_has_one_job() -> None:
    assert len(COMMANDS) == len(set(COMMANDS))
    assert sum(len(names) for _, names in JOBS.values()) == len(COMMANDS)


def test_the_first_help_explains_the_seven_commands_of_a_week_and_fits_a_screen_and_a_half() -> None:
    lines = said("--help").splitlines()
    assert len(JOBS["week"][1]) == 7
    assert len(lines) <= 60
    for name in JOBS["week"][1]:
        assert any(line.startswith(f"  {name} ") for line in lines), name


@pytest.mark.parametrize("job", JOBS)
def test_a_job_lists_its_commands_with_what_they_do(job: str) -> None:
    title, names = JOBS[job]
    page = said("help", job)
    assert page.startswith(f"{title}:")
    assert [line.split()[0] for line in page.splitlines() if line[2:3].strip() and line.startswith("  ")] == list(names)


def test_without_a_name_all_jobs_are_listed() -> None:
    page = said("help")
    assert all(page.count(f"\n  {name} ") == 1 for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_is_that_of_its_own_option(name: str) -> None:
    assert said("help", name).split("\n\n", 1)[1].strip() == said(name, "--help").split("\n\n", 1)[1].strip()


def test_an_unknown_name_is_refused_with_the_nearest_one() -> None:
    from vsd_analytics.errors import UsageError

    done = CliRunner().invoke(cli, ["help", "reprot"])
    assert isinstance(done.exception, UsageError)
    assert done.exception.fix == "vsd help report"


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("lines --lang it", "--language"), ("report --flor ground", "--floor"), ("hours --minute 15", "--minutes")],
)
def test_the_option_that_was_meant_is_the_fix(typed: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, typed.split()) == 2
    assert f"fix: write {meant}\n" in capsys.readouterr().err
