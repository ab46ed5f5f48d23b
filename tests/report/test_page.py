"""The page: self-contained, escaped, warnings first."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser

import pytest

from pipeline.core.errors import InputError
from pipeline.report.page import Figure, Number, Section, page
from pipeline.report.style import png

EVIL = '<script>alert("x")</script>'
PICTURE = png(lambda axes: axes.plot([0, 1], [1, 0]), width=40, height=30)


PLACES = ("title", "sub", "warning", "section", "text", "number", "value", "remark", "caption", "wide", "note", "foot")


class Balance(HTMLParser):
    """Every tag that is opened is closed, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def whole(text: str = "name") -> str:
    section = Section(
        title=f"section {text}",
        text=f"text {text}",
        numbers=[Number(f"number {text}", f"value {text}", f"remark {text}")],
        figures=[Figure(PICTURE, f"caption {text}"), Figure(PICTURE, f"wide {text}", wide=True)],
        notes=[f"note {text}"],
    )
    return page(
        f"title {text}", [section], subtitle=f"sub {text}", warnings=[f"warning {text}"], footer=[f"foot {text}"]
    )


def test_names_from_outside_cannot_run():
    html = whole(EVIL)
    assert "<script" not in html
    places = [
        "title",
        "sub",
        "warning",
        "section",
        "text",
        "number",
        "value",
        "remark",
        "caption",
        "wide",
        "note",
        "foot",
    ]
    for place in places:
        assert f"{place} &lt;script&gt;" in html
    assert '"x"' not in re.sub(r"<[^>]*>", "", html)  # nor can a quotation mark leave an attribute


def test_nothing_is_fetched_from_anywhere():
    html = whole()
    assert not re.search(r"(?:src|href|url)\s*[=(]\s*(?![\"']?data:)", html)
    assert "http" not in html.replace("http-equiv", "")
    assert "default-src 'none'" in html


def test_figures_are_inside_to_the_byte():
    found = re.findall(r'src="data:image/png;base64,([^"]+)"', whole())
    assert [base64.b64decode(one) for one in found] == [PICTURE, PICTURE]


def test_tags_are_balanced_and_everything_optional_can_be_missing():
    for html in (whole(), page("t", []), page("t", [Section("s")])):
        parser = Balance()
        parser.feed(html)
        assert not parser.open
    assert "table" not in parser.seen
    assert "footer" not in parser.seen
    assert "img" not in parser.seen


def test_warnings_stand_before_numbers_and_figures():
    html = whole()
    assert html.index("warning name") < html.index("number name") < html.index("caption name") < html.index("foot name")
    assert 'role="alert"' not in page("t", [])


def test_print_rules_are_there():
    html = whole()
    assert "@media print" in html
    assert "size: A4" in html
    assert "break-inside: avoid" in html


def test_only_pngs_are_taken():
    with pytest.raises(InputError, match="not a PNG"):
        Figure(b"<svg/>", "x")
