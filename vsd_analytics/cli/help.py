"""`vsd help`: the commands by job, or the help of one command."""

from __future__ import annotations

import click


@click.command(name="help")
@click.argument("name", required=False, metavar="[JOB|COMMAND]")
@click.pass_context
def help(ctx: click.Context, name: str | None) -> None:
    """Show all commands by job, the commands of one job, or the help of one command.

    \b
    Example:
      vsd help
      vsd help space
      vsd help report
    """
    import difflib

    from vsd_analytics.cli import JOBS, cli
    from vsd_analytics.errors import UsageError

    program = ctx.parent or ctx
    command = cli.get_command(program, name) if name is not None and name not in JOBS else None
    if command is not None:
        click.echo(command.get_help(click.Context(command, info_name=name, parent=program)))
        return
    if name is not None and name not in JOBS:
        near = difflib.get_close_matches(name, [*JOBS, *cli.list_commands(program)], n=1)
        raise UsageError(
            f"there is no job or command {name!r}",
            why=f"the jobs are: {', '.join(JOBS)}",
            fix=f"vsd help {near[0]}" if near else "vsd help",
        )
    formatter = program.make_formatter()
    for job in JOBS if name is None else (name,):
        cli.write_job(program, formatter, job)
    click.echo(formatter.getvalue().strip())
