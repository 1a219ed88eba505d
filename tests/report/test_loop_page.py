"""The interactive page draws the tables, needs no network, and works by keyboard."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from durations import HUNG_S
from made_loop_tables import CAMPAIGNS, facts_of, residual_table

from elastocal.io.origin import Origin
from elastocal.loop.schemas import stack_joint_angles
from elastocal.mechanics.kinematics import locate_corners
from elastocal.report.loop_page import build_loop_page, write_loop_page

CHROMIUM = shutil.which("chromium")
# Background colours of the page and of a plot.
PAPER_OF_PAGE = (
    "getComputedStyle(document.body).backgroundColor"
    ".match(/\\d+/g).slice(0, 3).map(Number)"
)
PAPER_OF_PLOT = (
    "[...document.getElementById('scatter').getContext('2d')"
    ".getImageData(1, 1, 1, 1).data].slice(0, 3)"
)
# Whether everything that is drawn in space lies on its canvas.
ALL_IN_SIGHT = """() => {
  const canvas = document.getElementById('robot');
  const { shown, ends } = projection(canvas.clientWidth, canvas.clientHeight);
  return ends.every((at) => {
    const [x, y] = shown(at);
    return x >= 0 && x <= canvas.clientWidth && y >= 0 && y <= canvas.clientHeight;
  });
}"""


def page_of(kuka, name="named", **changed):
    verdict = replace(CAMPAIGNS[name], **changed)
    return build_loop_page(facts_of(verdict), residual_table(), kuka)


def data_in(path):
    text = path.read_text(encoding="utf-8")
    return json.loads(
        re.search(
            r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL
        )[1]
    )


@pytest.fixture(scope="module")
def written(kuka, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_loop_page(path, *page_of(kuka), Origin("c0ffee" * 7, "d16e57aa" * 8, 7))
    return path


def test_measurements_are_in_metres_residuals_in_micrometres_against_quantities(
    kuka,
):
    table = residual_table()
    _, data = page_of(kuka)
    np.testing.assert_allclose(
        data["position"], np.column_stack([table[axis] for axis in "xyz"]), atol=1e-6
    )
    np.testing.assert_allclose(
        data["after"],
        1e6 * np.column_stack([table[f"after_d{axis}"] for axis in "xyz"]),
        atol=0.01,
    )
    assert data["held_out"] == table["held_out"].astype(bool).tolist()
    against = {entry["name"]: entry for entry in data["against"]}
    np.testing.assert_allclose(
        against["angle of joint 2"]["values"], np.degrees(table["q2"]), rtol=1e-4
    )
    # A constant quantity explains nothing.
    assert all(np.ptp(entry["values"]) > 0 for entry in data["against"])


def test_the_robot_is_drawn_at_the_angles_of_the_model(
    kuka,
):
    table = residual_table()
    verdict = CAMPAIGNS["named"]
    with_coupled_joints = replace(
        kuka,
        reported_matrix=np.diag([1.0, -1, -1, 1, 1, 1]),
        reported_offset=np.full(6, 0.3),
    )
    _, data = build_loop_page(facts_of(verdict), table, with_coupled_joints)
    np.testing.assert_allclose(
        data["outlines"][0],
        locate_corners(kuka.chain, stack_joint_angles(table, 6)[:1])[:, 0],
        atol=1e-4,
    )


def test_texts_from_files_are_never_run(kuka, tmp_path):
    """A campaign may have any name; the page shows it as text."""
    page, data = page_of(kuka)
    evil = "</script><script>alert(1)</script>"
    data = data | {"poses": [evil]}
    path = tmp_path / "report.html"
    write_loop_page(path, page | {"robot": evil}, data)
    assert "alert(1)</script>" not in path.read_text(encoding="utf-8").replace(
        "&lt;/script&gt;", ""
    )
    assert data_in(path)["poses"] == [evil]


def test_the_page_refers_to_no_file_but_the_report(written):
    text = re.sub(
        r"<script>.*?</script>",
        "",
        written.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    assert re.findall(r'(?:src|href)="(?!data:)([^"]*)', text) == ["report.pdf"]
    assert "@import" not in text and "url(" not in text


def check_stated_errors(page):
    """Check that errors of fitted and of validation poses are stated separately."""
    table = residual_table()
    residuals_um = 1e6 * np.column_stack([table[f"before_d{axis}"] for axis in "xyz"])
    for poses, held_out in (("fitted", False), ("validation", True)):
        selected = residuals_um[table["held_out"] == held_out]
        rms_um = np.sqrt((selected**2).sum(axis=1).mean())
        stated = re.search(
            rf"before .*?([\d.]+) µm \({poses}\)", page.inner_text("#scatter-words")
        )
        assert float(stated[1]) == pytest.approx(rms_um, rel=6e-3), poses


def get_drawing(page, plot):
    return page.evaluate(f"document.getElementById('{plot}').toDataURL()")


def check_controls(page):
    """Check that a key on each control changes a plot."""
    for control, key, plot in (
        ("shown", "ArrowDown", "robot"),
        ("which", "ArrowDown", "robot"),
        ("factor", "ArrowRight", "robot"),
        ("pose", "ArrowLeft", "robot"),
        ("robot", "ArrowUp", "robot"),
        ("robot", "+", "robot"),
        ("component", "ArrowDown", "scatter"),
        ("against", "ArrowDown", "scatter"),
        ("step", "ArrowDown", "scatter"),
    ):
        before = get_drawing(page, plot)
        page.focus(f"#{control}")
        page.keyboard.press(key)
        assert get_drawing(page, plot) != before, control


def check_buttons(page):
    """Check that each button changes the robot's plot, and keeps a view in sight."""
    for button in page.query_selector_all("button"):
        before = get_drawing(page, "robot")
        button.focus()
        page.keyboard.press("Enter")
        assert get_drawing(page, "robot") != before, button.inner_text()
        if button.get_attribute("data-view"):
            assert page.evaluate(ALL_IN_SIGHT)


@pytest.mark.skipif(CHROMIUM is None, reason="Debian's chromium is not installed")
@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_in_a_browser_every_control_works_by_key_and_nothing_leaves_the_page(
    written, width, scheme
):
    from playwright.sync_api import sync_playwright

    faults = []
    requests = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"]
        )
        page = browser.new_page(
            viewport={"width": width, "height": 844}, color_scheme=scheme
        )
        page.set_default_timeout(1000 * HUNG_S)
        page.on(
            "console",
            lambda message: (
                faults.append(message.text) if message.type == "error" else None
            ),
        )
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(written.as_uri())
        page.wait_for_selector("body[data-ready=yes]")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        papers = [page.evaluate(script) for script in (PAPER_OF_PAGE, PAPER_OF_PLOT)]
        assert papers[0] == papers[1] and (min(papers[0]) > 200) == (scheme == "light")
        assert page.evaluate(ALL_IN_SIGHT)

        check_stated_errors(page)
        check_controls(page)
        check_buttons(page)
        assert page.input_value("#pose") == page.evaluate("String(data.worst)")
        browser.close()
    assert faults == []
    assert [
        url for url in requests if not url.startswith(("file:", "data:", "blob:"))
    ] == []
