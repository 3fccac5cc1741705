"""`vsd whatif`: what an edit of the layout would do to the people recorded, or why that cannot be said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import FilePath, json_option
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import purged_hours_notes, resolve, warehouse_of
from vsd_analytics.errors import UsageError
from vsd_analytics.render.text import Layout, TableLayout
from vsd_analytics.wording.catalogue import say

if TYPE_CHECKING:
    from vsd_analytics.config.predictions import LayoutPrediction
    from vsd_analytics.whatif.scores import LoggedPrediction

BY_TRACK: Final = "people are counted by track id: somebody whose id was cut counts more than once"
LAYOUTS: Final[dict[str, Layout]] = {
    "whatif": (
        TableLayout(("number", "edit_kind", "edit_name", "edit_outcome", "n_near", "n_touched", "touched_share")),
    ),
    "whatif_choices": (
        TableLayout(
            (
                *("number", "edit_name", "touched_per_day", "touched_lo", "touched_hi"),
                *("more_per_day", "narrowest_m", "standing"),
            )
        ),
    ),
    "whatif_places": (
        TableLayout(
            ("number", "name", "close_min_per_open_h", "predicted_lo", "predicted_hi", "direction")
        ),
        TableLayout(("number", "name", "n_stays_leave", "n_stays_come"), only="n_stays_leave"),
        TableLayout(("number", "name", "close_time_share", "peak_people")),
        TableLayout(("number", "name", "room_m2", "new_room_m2", "room_level", "new_room_level"), only="room_level"),
        TableLayout(("number", "name", "iata_level"), only="iata_level"),
    ),
    "whatif_ways": (TableLayout(("number", "way_name", "free_m", "under_m", "n_people")),),
    "whatif_doors": (
        TableLayout(("number", "edit_name", "n_people", "one_way_share", "queue_share")),
        TableLayout(("number", "edit_name", "close_s_per_person", "predicted_close_s")),
    ),
    "whatif_stays": (TableLayout(("number", "edit_name", "n_stays", "stay_min", "close_share", "n_stays_moved")),),
    "predictions": (
        TableLayout(("number", "predicted_on", "first_date", "last_date", "n_ranges", "n_refused", "edit_print")),
    ),
    "prediction_record": (TableLayout(("record_of", "n_scored", "n_held", "held_share", "wider_by")),),
    "prediction_scores": (
        TableLayout(
            ("number", "entry", "name", "predicted_lo", "predicted_hi", "measured_change", "n_weeks_after", "held")
        ),
    ),
}  # fmt: skip


@click.command()
@click.argument("edit", type=FilePath(), required=False, metavar="[EDIT.toml]")
@click.option(
    "--range", "days", metavar="DAYS", help="Local days: 2026-11-09..2026-11-15 (default: everything stored)."
)
@click.option("--scores", is_flag=True, help="List the predictions, and how those came out that the change log names.")
@click.option("--no-receipt", is_flag=True, help="Store no receipt.")
@json_option
@pass_project
def whatif(project: Project, edit: Path | None, days: str | None, scores: bool, no_receipt: bool, as_json: bool) -> int:
    """Say what an edit of the layout would do to the people recorded, before it is built.

    The file names edits in the words of vsd.toml: a [[fixture]] at another place or at several, new, or with
    remove = true; a [[door]] of another width; a [[one_way]]; other hours under [site]. Each is answered by itself: who
    is touched, which ways stay free, and a range of the time too close where one was ever measured. All else is
    refused, with the reason (docs/whatif.md). Figures are exact, for the operator.

    What was predicted is stored in predictions.jsonl. An entry of the change log that names it (vsd log add
    --prediction N) has it scored: vsd whatif --scores.

    Exit code 1: every edit was refused.

    \b
    Example:
      vsd whatif display.toml --range 2026-11-02..2026-11-15
      vsd whatif display.toml --json
      vsd whatif --scores
    """
    if scores:
        if edit is not None or days is not None:
            raise UsageError("--scores takes no edit and no days", fix="vsd whatif --scores")
        return _scores(project, as_json=as_json)
    if edit is None:
        raise UsageError("which edit?", fix="vsd whatif EDIT.toml, or vsd whatif --scores")
    from vsd_analytics.answer import Answers
    from vsd_analytics.config.layout_edits import read_edits
    from vsd_analytics.config.predictions import add_prediction, prediction_dict, read_predictions
    from vsd_analytics.whatif.answers import whatif_answers
    from vsd_analytics.whatif.prediction import RELATIONS, layout_effects, reach_farther, receipt
    from vsd_analytics.whatif.scores import site_record

    first, last = resolve(project, week=None, days=days)
    edits = read_edits(edit, project.site, last_day=last)
    with warehouse_of(project, week=None, days=f"{first}..{last}", relations=RELATIONS) as warehouse:
        effects = layout_effects(warehouse, edits, first, last)
        notes = purged_hours_notes(warehouse)
    earlier = read_predictions(project.site)
    record = site_record(earlier, _logged(project, earlier))
    effects = reach_farther(effects, record.wider_by)
    answers = Answers(whatif_answers(effects, project.site, around=say("reason.row.around")))
    prediction = receipt(
        effects, made=project.now.astimezone(project.site.zone).date(), settings=project.site.settings.settings_id()
    )
    number = None if no_receipt or not prediction.ranges else add_prediction(project.site, prediction)
    stored = {
        "receipt": None if number is None else {"number": number, **prediction_dict(prediction)},
        "ranges_wider_by": record.wider_by,
    }
    print_answers(answers, days=(first, last), layouts=LAYOUTS, as_json=as_json, notes=notes, beside=stored)
    if not as_json:
        project.say(BY_TRACK)
        if record.wider_by:
            project.say(
                f"{record.n_held} of {record.n_scored} earlier predictions held here: ranges reach "
                f"{record.wider_by:.0%} farther on both sides"
            )
    if number is not None and not as_json:
        project.say(
            f"stored as prediction {number}; after the change: vsd log add TEXT --area ID --prediction {number}"
        )
    return 1 if all(row["edit_outcome"] == "refused" for row in answers["whatif"].rows) else 0


def _scores(project: Project, *, as_json: bool) -> int:
    from vsd_analytics.answer import Answers
    from vsd_analytics.config.predictions import read_predictions
    from vsd_analytics.whatif.scores import prediction_answers

    site = project.site
    predictions = read_predictions(site)
    if not predictions and not as_json:
        project.say("no predictions yet; make one: vsd whatif EDIT.toml")
        return 0
    logged = _logged(project, predictions)
    answers = Answers(prediction_answers(predictions, logged, site, today=project.now.astimezone(site.zone).date()))
    holds = answers["predictions"].holds_for
    print_answers(answers, days=(holds.first, holds.last), layouts=LAYOUTS, as_json=as_json, notes=())
    return 0


def _logged(project: Project, predictions: Sequence[LayoutPrediction]) -> list[LoggedPrediction]:
    """Return what became of the predictions that entries of the change log name; most sites have none, at once."""
    if not predictions:
        return []
    from vsd_analytics.whatif.scores import logged_predictions

    return logged_predictions(
        project.site, predictions, lambda first, last: warehouse_of(project, week=None, days=f"{first}..{last}")
    )
