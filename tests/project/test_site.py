"""The site of `make site`: every page, link and picture is there, and nothing is
fetched from elsewhere."""

import os
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from elastocal.command.campaign import diagnose
from elastocal.effects.catalogue import list_bundled_effects

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "site" / "html"

pytestmark = pytest.mark.slow


class Links(HTMLParser):
    """Addresses and anchors of a page."""

    def __init__(self, path):
        super().__init__()
        self.links = []
        self.anchors = set()
        self.formulas = 0
        self.pictures = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        self.links += [given[key] for key in ("href", "src") if given.get(key)]
        self.pictures += [given["src"]] if tag == "img" else []
        self.formulas += tag == "math"


@pytest.fixture(scope="module", autouse=True)
def built():
    """Of the sources as they are, with the gallery, and without a network if the tests
    may cut it."""
    ready = subprocess.run(
        ["make", ".venv/ready-for-tests"], cwd=ROOT, capture_output=True, text=True
    )
    assert ready.returncode == 0, ready.stderr[-2000:]
    cut = ["unshare", "--net"] if shutil.which("unshare") and not os.geteuid() else []
    command = [*cut, "make", "site"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


@pytest.fixture(scope="module")
def pages():
    return {path: Links(path) for path in SITE.rglob("*.html")}


def test_every_link_leads_to_a_file_and_an_anchor_that_are_there(pages):
    lost = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or link.startswith("//"):
                continue
            target = (
                (path.parent / unquote(parts.path)).resolve() if parts.path else path
            )
            anchor = unquote(parts.fragment)
            if not target.exists() or (
                anchor and target in pages and anchor not in pages[target].anchors
            ):
                lost.append(f"{path.relative_to(SITE)}: {link}")
    assert lost == []


def test_nothing_is_fetched_from_elsewhere(pages):
    """Links that a reader follows may lead away; styles, scripts, fonts and pictures
    may not."""
    fetched = re.compile(
        r'<(?:link|script|img|iframe)[^>]*(?:href|src)="(?:https?:)?//[^"]*"'
    )
    assert [
        address
        for path in pages
        for address in fetched.findall(path.read_text(encoding="utf-8"))
    ] == []
    styles = [
        path
        for path in SITE.rglob("*.css")
        if re.search(r"url\(\s*[\"']?(?:https?:)?//", path.read_text(encoding="utf-8"))
    ]
    assert styles == []


def test_every_effect_has_a_formula_and_a_picture(pages):
    page = pages[SITE / "reference" / "effects.html"]
    assert {Path(picture).stem for picture in page.pictures} >= set(
        list_bundled_effects()
    )
    assert page.formulas == len(list_bundled_effects())


# Headings without a level, code that no keyboard reaches (critical to axe), landmarks
# and columns without a name, figures without a link, control characters, and
# placeholders of figures.
WRONG = re.compile(
    r'role="heading"(?! aria-level)|<pre>|<aside class="[\w-]+">'
    r'|<th class="head"><p></p></th>|<p><img '
    r"|[\x00-\x08\x0b-\x1f]|@[A-Z]+@"
)


def test_no_page_has_what_cannot_be_read_or_reached_and_none_is_missing(pages):
    assert [
        (path.name, match)
        for path in pages
        for match in WRONG.findall(path.read_text(encoding="utf-8"))
    ] == []
    written = [
        path.relative_to(ROOT)
        for path in (ROOT / "docs").rglob("*.md")
        if path.name != "index.md"
    ]
    assert [
        page for page in written if not (SITE / page.with_suffix(".html")).is_file()
    ] == []
    commands = (SITE / "reference" / "commands.html").read_text(encoding="utf-8")
    assert diagnose.__doc__.split("\n")[0] in commands.replace("’", "'")
