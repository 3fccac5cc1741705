"""Documentation is held to the program: generated pages, commands that exist, links that lead somewhere, words."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import click
import generate_reference as reference
import pytest
from forbidden_words import forbidden_in
from markdown_pages import PAGES, REPOSITORY, anchors, commands, links

from vsd_analytics.cli import COMMANDS, cli
from vsd_analytics.cli.explain import explanations
from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.formats.adapters import GENERAL, SPECIFIC

GENERATED = sorted(reference.PAGES)
SOURCES = sorted((REPOSITORY / "vsd_analytics").rglob("*.py"))


def all_commands() -> list[tuple[str, click.Command]]:
    return list(reference.every_command())


def page_id(path: Path) -> str:
    return path.name


@pytest.mark.parametrize("name", GENERATED)
def test_generated_page_is_what_the_code_says(name: str) -> None:
    is_current = (REPOSITORY / "docs" / name).read_text(encoding="utf-8") == reference.PAGES[name]()
    assert is_current, f"docs/{name} follows settings, help texts and SQL headers: run `make docs`, see git diff"


@pytest.mark.parametrize("name", sorted(reference.PARTS))
def test_generated_part_of_a_page_is_what_the_code_says(name: str) -> None:
    text = (REPOSITORY / "docs" / name).read_text(encoding="utf-8")
    is_current = reference.with_part(text, reference.PARTS[name]()) == text
    assert is_current, f"a part of docs/{name} follows SQL headers: run `make docs`, see git diff"


def test_the_page_of_formats_lists_those_of_the_registry() -> None:
    guide = (REPOSITORY / "docs/formats.md").read_text(encoding="utf-8")
    part = reference.formats_markdown(guide)
    assert reference.with_part(guide, part, reference.FORMATS_BEGINS) == guide, "run `make docs`, see git diff"
    headings = re.findall(r"(?m)^### ([\w-]+): ", guide.partition("\n## Formats\n")[2].partition("\n## ")[0])
    assert {*headings} - {"Profiles"} == {*SPECIFIC, *GENERAL} - {"table"}


def test_every_command_has_help_an_example_and_an_entry() -> None:
    text = (REPOSITORY / "docs" / "cli.md").read_text(encoding="utf-8")
    for name, command in all_commands():
        assert command.help, name
        assert "Example:\n" in inspect.cleandoc(command.help), name
        assert f"\n## {name}\n" in text, name
        for option in command.params:
            assert not isinstance(option, click.Option) or option.help, f"{name} {option.name} has no help"
    assert {name.split()[1] for name, _ in all_commands()} == set(COMMANDS)


def test_examples_in_help_are_commands_that_exist() -> None:
    for name, command in all_commands():
        shown = re.findall(r"^\s+(vsd .+)$", command.help or "", re.M)
        assert shown, name
        for line in shown:
            parse(split(line))


REMOVED = {"bench"}
"""Commands of earlier versions, which the changelog names."""


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_commands_on_a_page_exist_with_their_options(page: Path) -> None:
    for words in commands(page):
        if page.name != "CHANGELOG.md" or words[1] not in REMOVED:
            parse(words)


def test_pages_are_searched_for_commands() -> None:
    assert sum(len(commands(page)) for page in PAGES) > 50
    with pytest.raises(click.UsageError):
        parse(["vsd", "prophesy"])
    with pytest.raises(click.UsageError):
        parse(["vsd", "hours", "--loud"])


def test_commands_in_messages_exist() -> None:
    """What a message tells people to type must be there to be typed."""
    found = 0
    for path in SOURCES:
        for word in re.findall(r"(?<![\w`.-])vsd (?:-C \w+ )?([a-z]+)\b", path.read_text(encoding="utf-8")):
            assert word in {*COMMANDS, "reads"}, f"{path.name}: vsd {word}"
            found += 1
    assert found > 40


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_relative_links_lead_somewhere(page: Path) -> None:
    for target in links(page):
        place, _, anchor = target.partition("#")
        path = (page.parent / place).resolve() if place else page
        assert path.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in anchors(path), f"{page.name}: {target}"


SCRIPT = re.compile(r"python (tests/[\w/]+\.py)((?: --[\w-]+)?[^`\n]*)")


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_scripts_on_a_page_exist_and_know_their_options(page: Path) -> None:
    for script, rest in SCRIPT.findall(page.read_text(encoding="utf-8")):
        code = (REPOSITORY / script).read_text(encoding="utf-8")
        for option in re.findall(r"(?<=\s)--[a-z][\w-]*", rest.partition(";")[0].partition("#")[0]):
            assert f'"{option}"' in code or "parse" not in code, f"{page.name}: {script} {option}"


def test_every_table_fact_and_mart_is_documented_column_by_column() -> None:
    from vsd_analytics.warehouse.sqlfiles import relations

    for layer, page in (("tables", "relations.md"), ("facts", "internal.md"), ("marts", "internal.md")):
        text = (REPOSITORY / "docs" / page).read_text(encoding="utf-8")
        for relation in relations(layer).values():
            name = relation.name if layer == "tables" else f"internal.{relation.name}"
            section = text.partition(f"\n### {name}\n")[2].partition("\n### ")[0]
            assert relation.description in section, relation.name
            for column in relation.columns:
                assert f"`{column}`" in section, f"{relation.name}.{column}"


def test_pages_never_claim_that_data_are_anonymous() -> None:
    for page in [*PAGES, *(REPOSITORY / "reports").rglob("*.j2")]:
        assert "anonym" not in page.read_text(encoding="utf-8").lower(), page.name


def test_help_and_messages_use_the_words_of_the_product() -> None:
    texts = {name: command.help or "" for name, command in all_commands()}
    texts |= {f"{n} {p.name}": p.help or "" for n, c in all_commands() for p in c.params if isinstance(p, click.Option)}
    texts |= explanations()
    for where, text in texts.items():
        assert forbidden_in(text) == [], where


def test_windows_is_refused_with_a_reason(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    import zoneinfo  # noqa: F401  (looks at the platform when first imported, which must be the true one)

    from vsd_analytics.cli import exit_codes

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(exit_codes.sys, "platform", "win32")
    assert exit_codes.run(cli, ["demo", "shop"]) == 2
    told = capsys.readouterr().err
    assert "error[E130]" in told
    assert "WSL" in told
    assert not (tmp_path / "shop").exists()
    assert exit_codes.run(cli, ["explain", "E130"]) == 0
    assert exit_codes.run(cli, ["--help"]) == 0


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_linux_and_macos_are_not_refused(platform: str) -> None:
    from vsd_analytics.cli.exit_codes import refuse_unsupported

    refuse_unsupported(platform)
    with pytest.raises(VsdError, match="Windows"):
        refuse_unsupported("win32")


def split(line: str) -> list[str]:
    import shlex

    return shlex.split(line.partition(" > ")[0], comments=True)


def parse(words: list[str]) -> None:
    """Parse a command as the program would, without running it; raise click.UsageError for what it does not know.

    A page may name a command by its first words only, or without its arguments.
    """
    context = click.Context(cli, info_name="vsd")
    arguments = [w for w in words[1:] if w not in ("...", "COMMAND") and not w.startswith("[")]
    command: click.Command = cli
    known = {o: p for p in cli.params for o in p.opts}
    while arguments:
        word = arguments[0]
        if word.startswith("-"):
            option = known.get(word)
            if option is None and word not in ("-h", "--help"):
                raise click.UsageError(f"no option {word} in: {' '.join(words)}")
            arguments = arguments[1:] if option is None or option.is_flag else arguments[2:]  # type: ignore[attr-defined]
            continue
        if isinstance(command, click.Group):
            found = command.get_command(context, word)
            if found is None:
                raise click.UsageError(f"no command {word!r} in: {' '.join(words)}")
            command = found
            known = {o: p for p in command.params if isinstance(p, click.Option) for o in (*p.opts, *p.secondary_opts)}
        arguments = arguments[1:]
