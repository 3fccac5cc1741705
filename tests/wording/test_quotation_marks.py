"""A quotation within a quotation has the inner marks of its language, whatever fills the places of a sentence."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import Markup

from vsd_analytics.answer import Reason
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.wording.catalogue import nested_quotes, say, say_html
from vsd_analytics.wording.languages import speaking
from vsd_analytics.wording.reasons import reason_text


@pytest.mark.parametrize(
    ("language", "name", "quoted"),
    [
        ("it", "Cassa «A»", "Telecamera «Cassa “A”»"),
        ("it", "Cassa “A”", "Telecamera «Cassa “A”»"),
        ("it", "Cassa", "Telecamera «Cassa»"),
        ("en", "Desk “A”", "Camera “Desk ‘A’”"),
        ("en", "the shop’s «A»", "Camera “the shop’s «A»”"),
        ("en", "5“ pipe", "Camera “5“ pipe”"),
    ],
)
def test_a_name_with_quotation_marks_in_a_quotation(language: str, name: str, quoted: str) -> None:
    with speaking(language):
        assert say("words.camera", name=name) == quoted
        assert say_html("words.camera", name=name) == Markup(quoted)


def test_a_sentence_with_a_quotation_in_a_quotation() -> None:
    with speaking("it"):
        asked = say("asked.week", week=46, question=say("ask.movable", fixture="Espositore", area="Cassa"))
    assert asked == "La settimana 46 ha chiesto: «Si potrebbe allontanare “Espositore” da Cassa?»"


def test_a_reason_has_them_too() -> None:
    with speaking("it"):
        assert reason_text(Reason("whatif.place", name="Cassa «A»")) == "«Cassa “A”»"


@given(st.sampled_from(LANGUAGES), st.text(alphabet="a «»“”‘’.", max_size=30))
def test_other_characters_stay_and_two_quotations_side_by_side_too(language: str, text: str) -> None:
    with speaking(language):
        marked = nested_quotes(text)
        assert [c for c in marked if c not in "«»“”‘’"] == [c for c in text if c not in "«»“”‘’"]
        side_by_side = f"{say('format.quoted', text='a')} {say('format.quoted', text='b')}"
        assert nested_quotes(side_by_side) == side_by_side
