"""Proves what the pages say: every sentence of the pages of some hundred weeks against a planted truth.

`sceptic_worlds` draws sites and makes pages; `sceptic_judges` says what each sentence claims and whether the truth
allows it. Sentences are those of headline, lead, things to know, question, key figures, areas, titles, cards, ledger of
changes, answers and the planner's log. A claim that a change worked must never be wrong; of all others at most 5 % may
be, as ranges are 95 % ranges.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest import mock

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).parents[2] / name) for name in ("", "figures", "stats")]

from sceptic_judges import UNJUDGED, Said, claims_nothing, is_about_worked, judge_of
from sceptic_worlds import TALES, Tale, Truth, sites_of, weeks_of

from vsd_analytics.planner.change_words import change_words
from vsd_analytics.planner.logged_changes import PlannerChange
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.change_story import came_of
from vsd_analytics.report.pages.week import Page, make_page
from vsd_analytics.site.model import Area
from vsd_analytics.wording import catalogue

PARTS: Mapping[str, tuple[str, ...]] = {
    "headline": ("headline.", "nothing."),
    "lead": ("lead.", "nothing.", "reason."),
    "things to know": ("things.", "nothing."),
    "question": ("question.", "ask.", "again.", "nothing."),
    "key figures": ("tiles.",),
    "titles": ("titles.", "when.unusual", "contributions.title", "trend.", "next.", "nothing."),
    "cards": ("spots.", "ask."),
    "ledger": ("logged_changes.", "came_of."),
    "answers": ("came_of.",),
    "planner": ("planner.log.", "came_of."),
}
"""Parts of a page, and how the keys of their sentences begin. What else a key fills in is a value, judged with it."""


@dataclass
class Count:
    """How many sentences claim something, and which of them claim too much."""

    claims: int = 0
    sentences: int = 0
    wrong: list[tuple[Said, Truth]] = field(default_factory=list)


class _Template(str):
    """A sentence of the catalogue that remembers what it was filled with."""

    __slots__ = ("key", "log")
    key: str
    log: list[tuple[str, dict[str, object], str]]

    def format(self, *args: object, **values: object) -> str:
        text = str.format(self, *args, **values)
        self.log.append((self.key, values, text))
        return text


@contextmanager
def recorded() -> Iterator[list[tuple[str, dict[str, object], str]]]:
    """Yield a list that every sentence taken from the catalogue is added to: key, values, text."""
    log: list[tuple[str, dict[str, object], str]] = []
    plain = catalogue.template

    def template(key: str, /, *, plural: float | None = None) -> str:
        made = _Template(plain(key, plural=plural))
        made.key, made.log = key, log
        return made

    with mock.patch.object(catalogue, "template", template):
        yield log


def said_on(report: WeekReport) -> tuple[list[Said], list[str]]:
    """Return the sentences of a page by key, and those without any key."""
    changes = {c.number: c for c in report.change_effects}
    with recorded() as log:
        page = make_page(replace(report, story=None))
        answers = {number: came_of(change) for number, change in changes.items()}
        planner = {number: _planner(change) for number, change in changes.items()}
    story = page.story
    lead = "".join(s.text for s in story.lead)
    found: list[Said] = []
    bare: list[str] = []

    asked = {r: f"ask.{r.key}" for place in (report.agenda.places if report.agenda else ()) for r in place.remedies}
    log += [(key, {}, text) for r, key in asked.items() for text in (r.text, r.again, r.short)]

    def add(place: str, sentence: str, **more: Any) -> None:
        keys = {
            key: values
            for key, values, text in log
            if key.startswith(PARTS[place]) and text.strip(" .,:;") and text.strip().casefold() in sentence.casefold()
        }
        if sentence and not keys:
            bare.append(f"{place}: {sentence}")
        one = Said(place=place, key="", sentence=sentence, report=report, keys=frozenset(keys), **more)
        found.extend(replace(one, key=key, values=values) for key, values in keys.items())
        if place == "headline" or sentence == lead:
            found.append(replace(one, key=f"{place}.names_missing"))

    add("headline", story.headline)
    add("lead", lead)
    for note in story.notes:
        add("lead", note)
    for thing in story.things:
        area = next((k for k in range(8) if f"Place-{k}" in thing.title), None)
        change = next((c for c in changes.values() if c.area_name in thing.title), None)
        add("things to know", f"{thing.title}. {thing.text}", area=area, change=change)
    add("question", story.question)
    for title in _titles(page):
        add("titles", title)
    for tile in page.tiles:
        add("key figures", f"{tile.title} {tile.note} {tile.also}")
    for card in page.cards.cards if page.cards else ():
        add("cards", f"{card.change} {card.when} {card.sure} {card.reason} {card.ask}".strip())
    lines = {line.number: line for line in report.logged_changes}
    for row in page.log:
        line = next((one for one in lines.values() if row.result and one.text in row.text), None)
        if line is not None:
            add("ledger", row.result, line=line, change=changes.get(line.number))
    for number, change in changes.items():
        add("answers", answers[number], change=change)
        add("planner", planner[number], change=change)
    return [*found, *_by_verdict(report)], bare


def _titles(page: Page) -> Iterator[str]:
    yield from page.titles.values()
    if page.trend is not None:
        yield from page.trend.notes
        yield from (panel.title for panel in page.trend.panels)
    if page.unusual is not None:
        yield from (page.unusual.title, *page.unusual.lines)
    if page.contributions is not None:
        yield page.contributions.title


def _planner(change: Any) -> str:
    place = Area(change.area_name.lower(), change.area_name, "ground", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    logged = PlannerChange(
        number=change.number, at=change.at, text=change.text, area=place, answers=None, result=change,
        before=None, after=None,
    )  # fmt: skip
    return change_words(logged).verdict


def _by_verdict(report: WeekReport) -> Iterator[Said]:
    """Yield what the page says by the word of a verdict, a range or a figure alone."""

    def said(place: str, key: str, name: str, **more: Any) -> Said:
        e = more["estimate"]
        shown = f"{name}: {e.verdict}, {e.change} ({e.change_lo} to {e.change_hi})"
        return Said(place=place, key=key, sentence=shown, report=report, **more)

    is_compared = report.state == "normal"
    for row in report.areas:
        if row.area_id is None:
            continue
        k = int(row.area_id.rsplit("-", 1)[1])
        yield said("areas", "area.level", f"{row.name} {row.violation_rate.value}", estimate=row.violation_rate, area=k)
        if is_compared:
            yield said("areas", "area.range", row.name, estimate=row.violation_rate, area=k)
        for e, what in ((row.violation_rate, "how often"), (row.close_time_share, "time too close")):
            if is_compared and e is not None and e.verdict is not None:
                yield said("areas", f"area.{e.verdict}", f"{row.name}, {what}", estimate=e, area=k)
    for what, e in (("violation_rate", report.level.violation_rate), ("close", report.level.close_time_share)):
        if is_compared and e is not None and e.verdict is not None and e.value is not None:
            yield said("key figures", f"tiles.{what}.{e.verdict}", f"tile {what}", estimate=e)
            yield said("areas", "floor.range", f"whole floor, {what}", estimate=e)
    for card in report.spots.cards if report.spots else ():
        if card.area_id is not None and card.violation_rate is not None:
            k = int(card.area_id.rsplit("-", 1)[1])
            yield said("cards", "spots.level", f"card {card.name}", estimate=card.violation_rate, area=k)
    for change in report.change_effects:
        kinds = (
            ("violation_rate", change.violation_rate),
            ("close", change.close),
            ("running", change.running),
            ("net", change.net),
        )
        for kind, e in kinds:
            if e is not None and e.change is not None and change.state == "ok" and change.effect is not None:
                name = f"{change.area_name} {kind}"
                if e.verdict is not None:
                    yield said("redesigns", f"change_effects.{kind}.{e.verdict}", name, estimate=e, change=change)
                yield said("redesigns", f"change_effects.{kind}.range", name, estimate=e, change=change)


@dataclass
class Findings:
    """What the sentences of many pages claim.

    Attributes:
        by_place, by_world: Counts by part of the page and by tale.
        worked: Of sentences that lay a change to what was done.
        unjudged: Keys that nobody judges, and how often they are said.
        bare: Sentences without a key.
        keys: How often each key is judged.
        n_weeks: Pages.
    """

    by_place: defaultdict[str, Count] = field(default_factory=lambda: defaultdict(Count))
    by_world: defaultdict[str, Count] = field(default_factory=lambda: defaultdict(Count))
    worked: Count = field(default_factory=Count)
    unjudged: Counter[str] = field(default_factory=Counter)
    bare: Counter[str] = field(default_factory=Counter)
    keys: Counter[str] = field(default_factory=Counter)
    n_weeks: int = 0

    @property
    def others(self) -> Count:
        """Return the counts of all sentences but those of `worked`."""
        total = Count()
        for count in self.by_place.values():
            total.claims += count.claims
            total.sentences += count.sentences
            total.wrong += count.wrong
        return total

    def read(self, report: WeekReport, truth: Truth) -> None:
        """Judge the sentences of a page."""
        self.n_weeks += 1
        sentences, bare = said_on(report)
        self.bare.update(bare)
        for said in sentences:
            judge = judge_of(said.key)
            if judge is None:
                if not claims_nothing(said.key):
                    self.unjudged[said.key] += 1
                continue
            is_allowed = judge(said, truth)
            others = [self.by_place[said.place], self.by_world[truth.tale.name]]
            for count in [self.worked] if is_about_worked(said.key) else others:
                count.sentences += 1
                count.claims += is_allowed is not None
                if is_allowed is not None and not is_allowed:
                    count.wrong.append((said, truth))
            self.keys[said.key] += is_allowed is not None


def findings(tales: Iterable[Tale], *, n_sites: int, seed: int, first: int = 0) -> Findings:
    """Return what the pages of so many sites of each tale claim."""
    found = Findings()
    for tale in tales:
        drawn = sites_of(tale, first + n_sites, seed)
        for site in range(first, first + n_sites):
            with tempfile.TemporaryDirectory() as folder:
                for truth, report in weeks_of(tale, drawn, site, Path(folder)):
                    found.read(report, truth)
    return found


def share(count: Count) -> str:
    return f"{len(count.wrong)} of {count.claims:,} ({len(count.wrong) / max(1, count.claims):.1%})"


def worst(found: Findings, n: int = 10) -> Iterator[str]:
    """Yield the wrong sentences to read first: those that lay a change to what was done, then the commonest keys."""
    common = Counter(said.key for said, _ in found.others.wrong)
    seen: Counter[str] = Counter()
    ordered = [*found.worked.wrong, *sorted(found.others.wrong, key=lambda w: -common[w[0].key])]
    for said, truth in ordered:
        seen[said.key] += 1
        if seen[said.key] > 2:
            continue
        true = {k: truth.ratio([k]) for k in said.areas or range(8)}
        planted = ", ".join(f"place-{k} {r:.2f}" for k, r in true.items() if r is not None)
        yield (
            f"{truth.tale.name}, site {truth.site}, week {truth.week - truth.start // 7}: “{said.sentence}” "
            f"({said.key}); true ratios: {planted}; cameras down: {truth.silent() or 'none'}"
        )
        n -= 1
        if not n:
            return


def main() -> None:
    """Print the table of docs/methods/pages.md, what nobody judged, and the worst sentences."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=int, default=3, help="sites of each tale")
    parser.add_argument("--first", type=int, default=0, help="number of the first site: to go on where a run ended")
    parser.add_argument("--seed", type=int, default=20261123)
    parser.add_argument("--only", default="", help="tales whose names hold this")
    parser.add_argument("--all", action="store_true", help="print every wrong sentence")
    arguments = parser.parse_args()
    started = time.process_time()
    chosen = [tale for tale in TALES if arguments.only in tale.name]
    found = findings(chosen, n_sites=arguments.sites, seed=arguments.seed, first=arguments.first)
    print("| sentences | promised | claim more than the truth allows |\n|---|---|---|")
    print(f"| that a change worked or moved on | none | {share(found.worked)} |")
    print(f"| all others | at most 5 % | {share(found.others)} |")
    for name, count in sorted(found.by_place.items()):
        print(f"| {name} | at most 5 % | {share(count)} |")
    print("\n| world | claim more than the truth allows |\n|---|---|")
    for name, count in found.by_world.items():
        print(f"| {name} | {share(count)} |")
    print(f"\n{found.n_weeks} site-weeks; {len(found.keys)} kinds of sentences judged")
    print("nobody judged:", dict(found.unjudged) or "none")
    print("cannot be judged here:", ", ".join(UNJUDGED))
    print("without a key:", dict(found.bare.most_common(20)) or "none")
    print("wrong by key:", dict(Counter(s.key for s, _ in [*found.others.wrong, *found.worked.wrong]).most_common()))
    print("judged by key:", dict(found.keys.most_common()))
    for k, line in enumerate(worst(found, 1000 if arguments.all else 10), 1):
        print(f"{k}. {line}")
    print(f"\n{time.process_time() - started:.0f} s of processor time")


if __name__ == "__main__":
    main()
