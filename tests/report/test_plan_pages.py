"""The sheet of a plan has a row for each pose, in degrees, with a box for each
measurement."""

import json
from collections import Counter
from dataclasses import replace
from functools import cache
from importlib import resources

import numpy as np
import pytest
import typst
from drawn_figures import empty_pictures
from made_surveys import make_candidates, make_survey

from elastocal.application.planning.plan import choose_plan
from elastocal.application.planning.sheet import build_sheet
from elastocal.campaigns.campaign import Target
from elastocal.figures.style import create_panels
from elastocal.report.plan_pages import collect_plan_facts
from elastocal.report.typesetting import compile_document

# Height of a page of pictures of 56 poses.
POSES_MM = 216


@cache
def make_plan():
    survey = make_survey()
    plan = choose_plan(survey, make_candidates(survey, 300), 14, 4, 1)
    return survey, plan, build_sheet(survey, plan)


def test_a_row_has_the_angles_in_degrees_and_as_many_boxes_as_measurements():
    survey, plan, rows = make_plan()
    facts = collect_plan_facts(survey, plan, rows, ["worth"])
    angles = np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles])
    assert len(facts["rows"]) == len(angles) == 18 and facts["fitted"] == 14
    for row, expected in zip(facts["rows"], angles, strict=True):
        shown = np.array(row["cells"][1 : 1 + survey.robot.joints], float)
        np.testing.assert_allclose(shown, np.degrees(expected), atol=0.006)
        assert len(row["cells"]) + 1 == len(facts["heads"])
    boxes = sum(visit["count"] for row in facts["rows"] for visit in row["visits"])
    assert boxes * len(survey.targets) == len(rows)
    # The sheet states where the reflector has to sit, because no later error shows it.
    with_offset = replace(survey, targets=(Target("T", "tool0", (0.1, 0.0, 0.05)),))
    assert (
        "T on point tool0, at the offset (100.00, 0.00, 50.00) mm"
        in collect_plan_facts(with_offset, plan, rows, ["worth"])["targets"][0]
    )
    assert "an unknown offset, which is fitted" in facts["targets"][0]


def test_the_sheet_is_typeset(tmp_path):
    facts = collect_plan_facts(*make_plan(), ["It is worth the effort."])
    pictures = empty_pictures(tmp_path, ["overview", "poses0"])
    compile_document(tmp_path / "plan.pdf", "plan.typ", {"facts": facts}, pictures)
    assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")


# Marks on which page the rows of the table and the first picture stand.
MARKED_PLAN = r"""#show regex("row\d+"): it => [#it #context [#metadata(here().page())<row>]]
#show image: it => it + context [#metadata(here().page())<picture>]
#show heading: it => it + context [#metadata(here().page())<heading>]
#include "plan.typ"
"""


@pytest.mark.parametrize("poses", [30, 36, 74])
def test_no_row_and_no_caption_stands_alone_on_a_page(poses, tmp_path):
    """A page of pictures is as tall as that of the most poses that it shows."""
    row = {"cells": ["0.00"], "visits": [{"load": "0", "count": 1}]}
    facts = collect_plan_facts(*make_plan(), ["worth"])
    facts["heads"] = ["pose", "q1", "measured"]
    facts["rows"] = [
        row | {"cells": [f"row{pose}", "0.00"]} for pose in range(1, poses + 1)
    ]
    for name, height_mm in (("overview", 60), ("poses0", POSES_MM)):
        create_panels(1, 1, height_mm)[0].savefig(tmp_path / f"{name}.pdf")
    for name, content in (("facts", facts), ("figures", ["overview", "poses0"])):
        (tmp_path / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    (tmp_path / "origin.json").write_text('""', encoding="utf-8")
    for name in ("plan.typ", "sheet.typ"):
        text = resources.files("elastocal.report").joinpath(name).read_text("utf-8")
        (tmp_path / name).write_text(text, encoding="utf-8")
    marked = tmp_path / "marked.typ"
    marked.write_text(MARKED_PLAN, encoding="utf-8")
    rows, pictures, headings = (
        json.loads(typst.query(marked, f"<{mark}>", field="value"))
        for mark in ("row", "picture", "heading")
    )
    assert len(rows) == poses
    assert min(Counter(rows).values()) >= 3
    # Headings of the poses, of the pictures and of the plan's worth.
    assert pictures == headings[1:]


def test_a_hanging_load_is_a_mass():
    survey, plan, _ = make_plan()
    hanging = replace(survey, force_N=196.133, pulled=False)
    facts = collect_plan_facts(hanging, plan, build_sheet(hanging, plan), ["worth"])
    assert facts["heads"][-2] == "hang (kg)" and facts["hanging"]
    assert all(row["cells"][-1] == "20.00" for row in facts["rows"])
    assert not any("(N)" in head for head in facts["heads"])
    pulled = replace(hanging, pulled=True)
    facts = collect_plan_facts(pulled, plan, build_sheet(pulled, plan), ["worth"])
    assert facts["heads"][-4:-1] == ["Fx (N)", "Fy (N)", "Fz (N)"]
