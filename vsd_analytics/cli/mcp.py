"""`vsd mcp`: answers for an assistant, by the Model Context Protocol."""

from __future__ import annotations

import click

from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError


@click.command()
@pass_project
def mcp(project: Project) -> None:
    """Answer an assistant's questions about this project, by the Model Context Protocol.

    The assistant reads what readers of the weekly reports may read, with small counts hidden; it computes and changes
    nothing. It starts the command itself and speaks over standard input and output: give it vsd -C FOLDER mcp. It needs
    pip install "vsd-analytics[mcp]".

    \b
    Example:
      vsd -C /var/lib/vsd/shop mcp
    """
    from vsd_analytics.cli.explain import explanations
    from vsd_analytics.service.answers import ReportAnswers
    from vsd_analytics.wording.manual import Manual

    try:
        from vsd_analytics.service.mcp_server import mcp_server
    except ModuleNotFoundError as error:
        raise UsageError(
            "the Model Context Protocol needs the extra mcp",
            why=f"{error.name} is not installed",
            fix='pip install "vsd-analytics[mcp]"',
        ) from None
    now = project.now if project.now_text is not None else None
    mcp_server(ReportAnswers(project.root, now=now), manual=Manual(explanations())).run("stdio")
