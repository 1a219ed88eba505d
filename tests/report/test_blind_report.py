"""The report of the blind proof says what its tables say: what is reached, what is missed, and what nothing can be said of."""

import pandas as pd
import pytest
from made_blind_documents import effect, frame, oracle, silence, truth, verdict

from elastocal.blind.calibration import statements
from elastocal.blind.confusion import confused
from elastocal.blind.coverage import covered, intervals_of
from elastocal.blind.power import powers, undetectable
from elastocal.blind.targets import by_setting, summarized
from elastocal.figures.style import panels, save
from elastocal.report.blind_facts import blind_facts
from elastocal.report.blind_pages import write_blind_report

FIGURES = ("targets", "power", "reliability", "confusion", "errors", "coverage", "sweep")
PAYLOAD = verdict("named", effect("payload"))
SWEEP = ["pair", "angle_up_to_deg", "cases"]
SWEEP += [f"{name}{end}" for name in ("right", "class", "wrong", "other") for end in ("", "_low", "_high")]
FOLLOW_UP = ["robots", "arm", "poses_added", "cases", "right_name", "low", "high"]


def scale():
    document = truth(("force_scale",))
    document["defects"][0]["of"] = "raw"
    return document


def tables(folder, *entries, follow_up=(), sweep=()):
    """As the pipeline has them: written and read again."""
    cases = frame(*entries)
    intervals = pd.DataFrame([row for document, said, _ in entries for row in intervals_of(document, said)])
    made = {
        "cases": cases,
        "summary": summarized(cases, intervals, statements((document, said) for document, said, _ in entries), 1),
        "settings": by_setting(cases),
        "confusion": confused(cases),
        "power": powers(cases),
        "coverage": covered(intervals),
        "undetectable": undetectable(cases),
        "follow_up": pd.DataFrame(follow_up, columns=FOLLOW_UP),
        "sweep": pd.DataFrame(sweep, columns=SWEEP),
    }
    for name, table in made.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    return {name: pd.read_csv(folder / f"{name}.csv") for name in made}


def facts_of(folder, *entries, **options):
    return blind_facts(tables(folder, *entries, **options), "aa  case_x.json\n", "quick", 7)


PROOF = (
    *[(truth(), silence(), oracle(1.0))] * 3,
    (truth(("payload",)), PAYLOAD, oracle()),
    (truth(("payload",)), silence(), oracle()),
    (truth(("outside:refraction",), group="outside", level=200.0), PAYLOAD, None),
    (scale(), silence(), oracle(1.0)),
    (truth(("payload",), robot="kuka"), PAYLOAD, oracle()),
)
MEASURED = [("proof", "proposed", 5, 12, 0.75, 0.43, 0.95)]


def test_targets_are_said_to_be_reached_or_missed_with_their_figures(tmp_path):
    facts = facts_of(tmp_path, *PROOF, follow_up=MEASURED)
    rows = {row[0]: row[1:] for row in facts["targets"]["proof"]}
    assert rows["detected at 50"][:2] == ["1 of 2", "50.0 %"] and rows["detected at 50"][-1] == "missed"
    assert rows["effect adopted and held-out RMS worse by over two standard errors"][-1] == "reached"
    assert any(line.startswith("detected at 50: 50.0 % (1.3–98.7 %), target at least 98 %") for line in facts["missed"])
    ends = [row[-1] for row in rows.values()]
    # Four hard settings, pairs, stated probabilities and their 95 % sets, and parameters of effects.
    assert rows["95 % intervals of effects' parameters"][-1] == "no case"
    assert rows["false alarms, force 3kN"][-1] == "no case"
    without = ends.count("no case")
    assert facts["verdict"].startswith(f"{ends.count('reached')} of {len(ends) - without} figures")
    assert len(facts["missed"]) == ends.count("missed")


def test_robots_of_the_proof_and_of_tuning_are_told_apart(tmp_path):
    facts = facts_of(tmp_path, *PROOF)
    assert facts["robots"] == {"proof": "gp180", "tuned": "kuka"} and facts["proof"]
    assert {row[0]: row[1] for row in facts["targets"]["tuned"]}["detected at 50"] == "1 of 1"


def test_a_run_without_a_robot_of_the_proof_says_that_it_proves_nothing(tmp_path):
    facts = facts_of(tmp_path, (truth(robot="kuka"), silence(), oracle(1.0)))
    assert not facts["proof"] and "proves nothing" in facts["verdict"]


def test_what_is_said_of_foreign_effects_adds_up(tmp_path):
    (row,) = facts_of(tmp_path, *PROOF)["outside"]
    assert row == ["refraction", "200", "1", "100", "0", "0", "0", "0"]


def test_what_is_absorbed_is_listed_with_its_reason(tmp_path):
    (row,) = facts_of(tmp_path, *PROOF)["undetectable"]
    assert row[0] == "force scale" and row[3] == "absorbed by the joint compliances" and row[4] == "0 of 1"


def test_follow_up_rows_are_worded(tmp_path):
    assert facts_of(tmp_path, *PROOF, follow_up=MEASURED)["follow_up"] == [["proof", "proposed", "5", "12", "75 %", "43–95 %"]]


def test_near_relatives_are_told_for_all_pairs_together(tmp_path):
    shares = [0.5, 0.2, 0.8, 0.25, 0.1, 0.4, 0.25, 0.1, 0.4, 0.0, 0.0, 0.2]
    rows = [("all", 20.0, 4, *shares), ("payload / link_weight", 20.0, 4, *shares)]
    found = facts_of(tmp_path, *PROOF, sweep=rows)["sweep"]
    assert found == [["20°", "4", "50 (20–80)", "25 (10–40)", "25 (10–40)", "0 (0–20)"]]


@pytest.mark.parametrize("entries", [PROOF, ((truth(robot="kuka"), silence(), oracle(1.0)),)])
def test_the_report_is_a_pdf(tmp_path, entries):
    pictures = []
    for name in FIGURES:
        pictures.append(f"{tmp_path}/{name}.pdf")
        save(panels(1, 1, 20)[0], pictures[-1], f"{tmp_path}/{name}.png")
    write_blind_report(f"{tmp_path}/blind.pdf", facts_of(tmp_path, *entries, follow_up=MEASURED), pictures)
    assert (tmp_path / "blind.pdf").read_bytes().startswith(b"%PDF")
