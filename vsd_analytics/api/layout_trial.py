"""Layouts tried on the people recorded on some days: edits as text, answers as tables."""

from __future__ import annotations

from datetime import date
from functools import cached_property, partial

from vsd_analytics.answer import Answer
from vsd_analytics.api.table import Table
from vsd_analytics.config.layout_edits import read_edits_text
from vsd_analytics.config.predictions import read_predictions
from vsd_analytics.render.frame import arrow
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.whatif.answers import whatif_answers
from vsd_analytics.whatif.floor_records import FloorRecords
from vsd_analytics.whatif.prediction import RELATIONS, everybody, layout_effects, reach_farther
from vsd_analytics.whatif.scores import SiteRecord, logged_predictions, site_record
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text


class LayoutTrial:
    """Tries edits of a layout on the people recorded on some days; stores nothing, not even a receipt.

    The people of a floor are read for its first edit and held in memory, so that a further edit takes a second or two.
    They are read again where records have come or gone since. Figures are exact and for the operator.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
    """

    def __init__(self, site: Site, first: date, last: date) -> None:
        self.site, self.first, self.last = site, first, last
        self._people: dict[str, FloorRecords] = {}
        self._inputs = ""

    @cached_property
    def _record(self) -> SiteRecord:
        earlier = read_predictions(self.site)
        return site_record(earlier, logged_predictions(self.site, earlier, partial(open_warehouse, self.site)))

    def __repr__(self) -> str:
        return f"{self.site.name}: a layout tried on {self.first} to {self.last}"

    def answer(self, edits: str) -> dict[str, Table]:
        """Return what edits do, as tables by name.

        `whatif` has a row for each edit, and its sentences in `note`. `whatif_places` has the range of the change of
        the time too close, `predicted_change` with `_lo` and `_hi`, around the edit, in areas and on the floor. Others,
        where there is anything to say, are `whatif_choices`, `whatif_ways`, `whatif_doors` and `whatif_stays`.

        Args:
            edits: Text as of a file of `vsd whatif`.

        Raises:
            ConfigError: E103, the text has mistakes; all are listed.
            UsageError: E101, records of the days were purged, or most of them near an edit have no track id.

        Example:
            >>> trial.answer("site = { opening = { mon-sun = '09:00-18:00' } }")["whatif"]["edit_kind"]
            ['opening']
        """
        read = read_edits_text(edits, self.site, last_day=self.last)
        with open_warehouse(self.site, self.first, self.last, relations=RELATIONS) as warehouse:
            if warehouse.inputs_digest != self._inputs:
                self._people, self._inputs = {}, warehouse.inputs_digest
            if read.floor_id not in self._people:
                self._people[read.floor_id] = everybody(warehouse, read.floor_id, self.first, self.last)
            people = self._people[read.floor_id]
            predicted = layout_effects(warehouse, read, self.first, self.last, people=people)
        predicted = reach_farther(predicted, self._record.wider_by)
        answers = whatif_answers(predicted, self.site, around=say("reason.row.around"))
        return {answer.name: self._table(answer) for answer in answers}

    def _table(self, answer: Answer) -> Table:
        note = "\n".join(reason_text(reason) for _, reason in answer.notes)
        return Table(arrow(answer), title=f"{answer.name}, {self.first} to {self.last}", note=note)
