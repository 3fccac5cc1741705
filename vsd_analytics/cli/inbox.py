"""`vsd inbox`: answers to the question of the week that came by mail."""

from __future__ import annotations

from pathlib import Path

import click

from vsd_analytics.cli.options import FilePath, json_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=FilePath(must_exist=True))
@click.option("--yes", is_flag=True, help="Store the answers; without it they are only printed.")
@json_option
@pass_project
def inbox(project: Project, files: tuple[Path, ...], yes: bool, as_json: bool) -> int:
    """Read answers to the question of the week from mails, saved as files or in a folder.

    Readers write them by a button of the page, or reply to the weekly mail. Anybody can send a mail under any name:
    look at what it says, then store it with --yes, as by vsd log answer. The same mail again changes nothing.

    Exit code 1: a mail is no answer; the message says why. The others are read.

    \b
    Example:
      vsd inbox answers/
      vsd inbox answers/re-week-46.eml --yes
    """
    from vsd_analytics.config.change_log import add_answer
    from vsd_analytics.report.send.mail_answers import MAIL_MAX_BYTES, NoAnswerError, mail_answer

    rows, code = [], 0
    for path in _mails(files):
        try:
            with path.open("rb") as file:
                answer = mail_answer(file.read(MAIL_MAX_BYTES + 1), project.site)
        except NoAnswerError as error:
            click.echo(f"{plain(path.name)} is no answer: {plain(str(error))}", err=True)
            code = 1
            continue
        at = answer.at
        if yes:
            add_answer(project.site, answer.question_id, answer.kind, at=at, text=answer.text or None, by=answer.by)
        rows.append({"file": path.name, "at": at.isoformat(), "question": answer.question_id, "answer": answer.kind,
                     "text": answer.text, "by": answer.by})  # fmt: skip
        if not as_json:
            who = f"  ({plain(answer.by)})" if answer.by else ""
            text = f"  {plain(answer.text)}" if answer.text else ""
            click.echo(f"{at.isoformat(timespec='minutes')}  {plain(answer.question_id)}  {answer.kind}{text}{who}")
    if as_json:
        emit_json({"answers": rows, "is_stored": yes})
    elif rows:
        stored = "stored: vsd log list --all shows them, and the next page says what was answered"
        project.say(stored if yes else "nothing was stored; to store these answers, add --yes")
    return code


def _mails(files: tuple[Path, ...]) -> list[Path]:
    """Return the files; of a folder, the files directly in it."""
    return [
        one for path in files for one in (sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path])
    ]
