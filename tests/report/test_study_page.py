"""The page of the study's tables has a row for each that the report states, and every figure of it."""

import re

from made_study_tables import facts, question_facts

from elastocal.report.study_page import study_page


def tables_of(page):
    """Rows of words under each heading, the names of columns first."""
    _, *parts = re.split(r"^## (.*)$", page, flags=re.MULTILINE)
    rows = {
        title: [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
        for title, text in zip(parts[::2], parts[1::2], strict=True)
    }
    return {title: [head, *body] for title, (head, _, *body) in rows.items()}


def test_each_table_has_the_rows_and_figures_of_the_report():
    stated = facts() | question_facts()
    tables = tables_of(study_page(stated))
    by_length = {title: len(rows) - 1 for title, rows in tables.items()}
    table4, claims, simulated = (len(stated[name]) for name in ("table4", "claims", "simulated"))
    assert [*by_length.values()] == [claims, table4, table4, table4, len(stated["break_even"]), simulated]
    assert sorted(tables["Claims of the paper"][1]) == sorted(stated["claims"][0].values())
    assert stated["table4"][0]["one reflector stiffness 1"] in tables["Table 4, positions of one reflector"][1]
    assert stated["simulated"][0]["gain"] == tables["Designs of 20 configurations, simulated"][1][-1]


def test_what_was_not_measured_is_left_empty():
    stated = facts() | question_facts()
    poses = [{name: value for name, value in row.items() if "reflector" not in name} for row in stated["table4"]]
    rows = tables_of(study_page(stated | {"table4": poses}))["Table 4, positions of three reflectors"]
    assert rows[1] == [poses[0]["robot"], poses[0]["strategy"], "", "", "", ""]
