"""The site of `make site`: every link and picture is there, it is searched, and it is read on a phone and in the dark."""

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import yaml
from durations import HUNG_S

from elastocal.command.campaign import diagnose
from elastocal.effects.catalogue import effects

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "site" / "html"
CHROMIUM = shutil.which("chromium")
PAGES = ("index.html", "docs/tutorial.html", "docs/study.html", "reference/files/campaign.html")
BACKGROUND = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"

pytestmark = pytest.mark.slow


class Links(HTMLParser):
    """Addresses and anchors of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors, self.formulas, self.pictures = [], set(), 0, []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        self.links += [given[key] for key in ("href", "src") if given.get(key)]
        self.pictures += [given["src"]] if tag == "img" else []
        self.formulas += tag == "math"


@pytest.fixture(scope="module", autouse=True)
def built():
    """Of the sources as they are."""
    done = subprocess.run(["make", "site"], cwd=ROOT, capture_output=True, text=True)
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
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            if not target.exists() or (anchor and target in pages and anchor not in pages[target].anchors):
                lost.append(f"{path.relative_to(SITE)}: {link}")
    assert lost == []


def test_nothing_is_fetched_from_elsewhere(pages):
    """Links that a reader follows may lead away; styles, scripts, fonts and pictures may not."""
    fetched = re.compile(r'<(?:link|script|img|iframe)[^>]*(?:href|src)="(?:https?:)?//[^"]*"')
    assert [found for path in pages for found in fetched.findall(path.read_text(encoding="utf-8"))] == []
    styles = [
        path for path in SITE.rglob("*.css") if re.search(r"url\(\s*[\"']?(?:https?:)?//", path.read_text(encoding="utf-8"))
    ]
    assert styles == []


def test_every_effect_has_a_formula_and_a_picture(pages):
    page = pages[SITE / "reference" / "effects.html"]
    assert {Path(picture).stem for picture in page.pictures} >= set(effects())
    assert page.formulas == len(effects())
    formulas = yaml.safe_load((ROOT / "docs" / "site" / "effect_formulas.yaml").read_text(encoding="utf-8"))
    assert set(formulas) == set(effects())


# Headings without a level, code that no keyboard reaches (critical to axe), landmarks and columns without a name, figures that
# lead nowhere, control characters, and figures that were to be filled in.
WRONG = re.compile(
    r'role="heading"(?! aria-level)|<pre>|<aside class="[\w-]+">|<th class="head"><p></p></th>|<p><img '
    r"|[\x00-\x08\x0b-\x1f]|@[A-Z]+@"
)


def test_no_page_has_what_cannot_be_read_or_reached_and_none_is_missing(pages):
    assert [(path.name, found) for path in pages for found in WRONG.findall(path.read_text(encoding="utf-8"))] == []
    written = [path.relative_to(ROOT) for path in (ROOT / "docs").rglob("*.md") if path.name != "index.md"]
    assert [page for page in written if not (SITE / page.with_suffix(".html")).is_file()] == []
    commands = (SITE / "reference" / "commands.html").read_text(encoding="utf-8")
    assert diagnose.__doc__.split("\n")[0] in commands.replace("’", "'")


@pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed")
@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_in_a_browser_pages_fit_the_screen_are_searched_and_fetch_nothing(width, scheme):
    from playwright.sync_api import sync_playwright

    faults, requests = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": width, "height": 844}, color_scheme=scheme)
        page.set_default_timeout(1000 * HUNG_S)
        page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        for name in PAGES:
            page.goto((SITE / name).as_uri())
            assert page.evaluate("document.documentElement.scrollWidth") <= width, name
            assert (min(page.evaluate(BACKGROUND)) > 200) == (scheme == "light"), name
            filters = set(page.evaluate("[...document.querySelectorAll('article img')].map(e => getComputedStyle(e).filter)"))
            assert all(("invert" in found) == (scheme == "dark") for found in filters), name
            page.evaluate("document.querySelectorAll('img').forEach(e => e.loading = 'eager')")
            page.wait_for_function("[...document.images].every(e => e.complete)")
            assert page.evaluate("[...document.images].filter(e => !e.naturalWidth).map(e => e.src)") == [], name
        # Dark, light and as the system has it, by the button.
        switch = page.locator("button.theme-toggle:visible").first
        seen = set()
        for _ in range(3):
            seen.add(tuple(page.evaluate(BACKGROUND)))
            switch.click()
        assert len(seen) == 2
        page.goto((SITE / "search.html").as_uri() + "?q=backlash")
        page.wait_for_selector("#search-results li a")
        assert any("effects" in link.get_attribute("href") for link in page.query_selector_all("#search-results li a"))
        browser.close()
    assert faults == []
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
