"""`vsd log`: the site's change log, and the answers to the report's questions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project, warn_of_broken_log_lines
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.site.model import LogEntry
    from vsd_analytics.site.questions import AnswerKind


@click.group()
def log() -> None:
    """Write and list the site's change log: what was moved, when and where.

    \b
    Example:
      vsd log add "moved the exhibit" --at 2026-11-11T12:00 --area entrance
      vsd log answer Q46-entrance-clear tried --by Anna
      vsd log list
    """


@log.command("add")
@click.argument("text")
@click.option("--at", metavar="INSTANT", help="When, in the site's zone unless it has an offset (default: now).")
@click.option("--area", metavar="ID", help="Area it concerns (default: the whole site).")
@click.option("--by", metavar="NAME", help="Who logs it.")
@click.option("--prediction", type=click.IntRange(min=1), metavar="N", help="Receipt that foresaw it: see vsd whatif.")
@json_option
@pass_project
def log_add(
    project: Project, text: str, at: str | None, area: str | None, by: str | None, prediction: int | None, as_json: bool
) -> None:
    """Add one entry. An entry with the same time, area and text as another is not added again.

    \b
    Example:
      vsd log add "moved the exhibit away from the entrance" --at 2026-11-11T12:00 --area entrance
    """
    from vsd_analytics.config.change_log import add_entry, entry_dict, entry_ids

    when = at if at is not None else project.now
    added = add_entry(project.site, text=text, at=when, area=area, by=by, prediction=prediction)
    for line in added.removed:
        click.echo(plain(f"removed an incomplete line: {line}"), err=True)
    if as_json:
        emit_json({"id": entry_ids(project.site)[added.entry], **entry_dict(added.entry), "is_new": added.is_new})
        return
    click.echo(_line(added.entry))
    if not added.is_new:
        project.say("the log has this entry already (same time, area and text): nothing was added")


@log.command("answer")
@click.argument("question", metavar="ID")
@click.argument("kind", metavar="ANSWER", type=click.Choice(["tried", "not-possible", "later"]))
@click.option("--text", metavar="TEXT", help="What was done, or why not (default: the words of the question).")
@click.option("--by", metavar="NAME", help="Who answers.")
@click.option("--at", metavar="INSTANT", help="When it was tried or decided, in the site's zone (default: now).")
@json_option
@pass_project
def log_answer(
    project: Project, question: str, kind: AnswerKind, text: str | None, by: str | None, at: str | None, as_json: bool
) -> None:
    """Answer a question of the weekly report: tried, not-possible or later.

    What was tried is a change of its area: the next reports compare before and after it. What is not possible is never
    asked again. A question for later is asked again after four weeks. A second answer supersedes the first.

    \b
    Example:
      vsd log answer Q46-entrance-clear tried --at 2026-11-18T07:00 --by Anna
      vsd log answer Q46-entrance-clear not-possible --text "the fire door needs the room"
    """
    from vsd_analytics.config.change_log import add_answer

    when = at if at is not None else project.now
    answer = add_answer(project.site, question, kind, at=when, text=text, by=by)
    if as_json:
        emit_json({"at": answer.at.isoformat(), "question": answer.question, "answer": answer.kind,
                   "text": answer.text, "area": answer.area_id, "by": answer.by})  # fmt: skip
        return
    click.echo(f"{answer.at.isoformat(timespec='minutes')}  {plain(answer.question)}  {answer.kind}")


@log.command("edit")
@click.argument("which", metavar="ID")
@click.option("--text", metavar="TEXT", help="What was changed.")
@click.option("--at", metavar="INSTANT", help="When, in the site's zone unless it has an offset.")
@click.option("--area", metavar="ID", help="Area it concerns.")
@click.option("--whole-site", is_flag=True, help="It concerns the whole site.")
@json_option
@pass_project
def log_edit(
    project: Project, which: str, text: str | None, at: str | None, area: str | None, whole_site: bool, as_json: bool
) -> None:
    """Correct an entry of the list. The entry as it was stays in the history: vsd log list --all.

    A correction that leaves the entry where it is in the list also takes the entry's number for the id.

    \b
    Example:
      vsd log edit e3f9a21b --at 2026-11-11T18:00
      vsd log edit e3f9a21b --area entrance --text "moved the exhibit"
    """
    from vsd_analytics.config.change_log import AS_IT_IS, edit_entry, entry_dict

    if area is not None and whole_site:
        raise UsageError("--area and --whole-site exclude each other", fix="leave one of them out")
    place = None if whole_site else AS_IT_IS if area is None else area
    edit = edit_entry(project.site, which, text=text, at=at, area=place)
    if edit.after is None:
        raise AssertionError("a corrected entry is there")
    if as_json:
        emit_json({**entry_dict(edit.after), "replaces": entry_dict(edit.before)})
        return
    click.echo(_line(edit.after))


@log.command("remove")
@click.argument("which", metavar="ID")
@click.option("--by", metavar="NAME", help="Who takes it back.")
@json_option
@pass_project
def log_remove(project: Project, which: str, by: str | None, as_json: bool) -> None:
    """Take back an entry of the list, or the last answer to a question. It stays in the history: vsd log list --all.

    The same command again changes nothing: an id stays that of its entry.

    \b
    Example:
      vsd log remove e3f9a21b
      vsd log remove Q46-entrance-clear --by Anna
    """
    from vsd_analytics.config.change_log import entry_dict, remove_entry

    removal = remove_entry(project.site, which, at=project.now, by=by)
    if as_json:
        emit_json({"removes": entry_dict(removal.before), "is_new": removal.is_new})
        return
    click.echo(f"{'removed' if removal.is_new else 'was removed before'}  {_line(removal.before)}")


@log.command("list")
@click.option("--all", "is_all", is_flag=True, help="The history: what was corrected, taken back and answered.")
@json_option
@pass_project
def log_list(project: Project, is_all: bool, as_json: bool) -> None:
    """List the entries by time: numbers for vsd compare --change, ids for vsd log edit and vsd log remove.

    \b
    Example:
      vsd log list
      vsd log list --all
      vsd log list --json
    """
    from vsd_analytics.config.change_log import entry_dict, entry_ids, read_log

    warn_of_broken_log_lines(project)
    if is_all:
        _history(project, as_json=as_json)
        return
    entries, ids = read_log(project.site), entry_ids(project.site)
    if as_json:
        emit_json({"log": [{"id": ids[entry], **entry_dict(entry)} for entry in entries]})
        return
    for number, entry in enumerate(entries, start=1):
        click.echo(f"{number:>3}  {ids[entry]}  {_line(entry)}")
    if not entries:
        project.say(
            'no entries yet (answers: vsd log list --all); add one: vsd log add "what was moved" --at 2026-11-11T12:00'
        )


def _history(project: Project, *, as_json: bool) -> None:
    """Print every line of the file, in the order in which it was added."""
    from vsd_analytics.config.change_log import entry_dict
    from vsd_analytics.config.log_records import read_records

    rows = []
    for record in read_records(project.site):
        entry = record.entry if record.entry is not None else record.answer
        kind = "removed" if entry is None else "corrected" if record.supersedes else "added"
        row: dict[str, object] = {"line": record.line, "kind": kind}
        if record.answer is not None and record.supersedes is None:
            row |= {"kind": record.answer.kind, "question": record.answer.question, "by": record.answer.by}
        if record.withdrawn_by is not None:
            row["by"] = record.withdrawn_by
        if entry is not None:
            row |= {"at": entry.at.isoformat(), "text": entry.text, "area": entry.area_id}
        if record.supersedes is not None:
            row["before"] = entry_dict(record.supersedes)
        rows.append((row, record))
    if as_json:
        emit_json({"history": [row for row, _ in rows]})
        return
    for row, record in rows:
        entry = record.entry or record.answer or record.supersedes
        if entry is None:
            continue
        place, question = plain(entry.area_id or "whole site"), plain(str(row.get("question") or ""))
        text = " ".join(part for part in (question, plain(entry.text)) if part)
        at = entry.at.isoformat(timespec="minutes")
        click.echo(f"{record.line:>3}  {row['kind']:<12}  {at}  {place}  {' '.join(text.split())}")
        if record.supersedes is not None and record.entry is not None:
            click.echo(f"     {'before':<12}  {_line(record.supersedes)}")


def _line(entry: LogEntry) -> str:
    text, area = " ".join(plain(entry.text).split()), plain(entry.area_id or "whole site")
    by = f"  ({plain(entry.by)})" if entry.by else ""
    return f"{entry.at.isoformat(timespec='minutes')}  {area}  {text}{by}"
