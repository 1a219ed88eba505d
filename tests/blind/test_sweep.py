"""The confounding sweep: designs and angles of its cases, and what is counted."""

import pytest
from analysed_robots import ROBOTS
from made_verdicts import truth, verdict_of
from scipy.stats import beta

from elastocal_proof.blind.cases import (
    SIZES,
    SWEEP_DESIGNS,
    SWEEP_PAIRS,
    Counts,
    angle_to_alternative,
    cases_of,
    design_of,
    specimen_of,
)
from elastocal_proof.blind.sweep import against_angle, swept
from elastocal_proof.plant.defects import Defect, with_defects

ONE = Counts(none=2, single=0, outside=0, pair=0, setting=0, sweep=1, robots=("kuka",))


def test_a_sweep_has_each_effect_of_each_pair_under_each_design_and_moves_no_other_case():
    cases = cases_of(ONE, 1)
    mine = [case for case in cases if case.group == "sweep"]
    expected = {(pair, design) for one in SWEEP_PAIRS for pair in (one, one[::-1]) for design in SWEEP_DESIGNS}
    assert {((case.effects[0], case.alternative), case.setting) for case in mine} == expected
    assert len(mine) == len(expected) and len({case.name for case in mine}) == len(mine)
    quick = {case.name for case in cases_of(SIZES["quick"], 1) if case.group != "sweep"}
    assert {case.name for case in cases_of(Counts(2, 0, 0, 0, 0, robots=("kuka",)), 1)} <= {case.name for case in cases}
    assert not quick & {case.name for case in mine}


@pytest.mark.slow
def test_the_angle_is_that_to_all_that_the_alternative_can_make():
    """A stiffness that depends on the angle by a phase of its own: of two phases all others are made."""
    case = next(
        c for c in cases_of(ONE, 1) if c.effects == ("compensator_stiffness",) and c.setting == "all points, ladder, wide"
    )
    robot, design = specimen_of(case, ROBOTS), design_of(case)
    same = with_defects(robot, [Defect("joint_dependent_stiffness", (2,), 0.1, 1)])
    assert angle_to_alternative(case, robot, design, same) < 3
    play = with_defects(robot, [Defect("lost_motion", (4,), 1e-4, 1)])
    assert angle_to_alternative(case, robot, design, play) > 60


def a_truth(angle, *effects):
    document = truth(*effects, group="sweep")
    return document | {"alternative": {"effect": "link_weight", "angle_deg": angle}}


def nearest(verdict, angle):
    return verdict | {"effects": [effect | {"angle_to_nearest_deg": angle} for effect in verdict["effects"]]}


TRUTHS = {name: a_truth(angle, "payload") for name, angle in zip("abcd", (3.0, 4.9, 5.1, 90.0), strict=True)}
TRUTHS["e"] = truth("payload")
VERDICTS = {
    "a": nearest(verdict_of("class", "link_weight", alternatives=["payload"]), 2.0),
    "b": nearest(verdict_of("named", "link_weight"), 30.0),
    "c": nearest(verdict_of("named", "payload"), None),
    "d": verdict_of("adequate"),
    "e": nearest(verdict_of("named", "payload"), 3.0),
}


def test_each_case_of_the_sweep_counts_in_the_bin_of_its_angle():
    cases = swept(TRUTHS, VERDICTS)
    assert cases["outcome"].tolist() == ["class", "wrong", "right", "other"]
    assert cases["pair"].unique().tolist() == ["link_weight / payload"]
    table = against_angle(cases)
    assert table["cases"].groupby(table["pair"]).sum().to_dict() == {"all": 4, "link_weight / payload": 4}
    row = table[(table["pair"] == "all") & (table["angle_up_to_deg"] == 5)].iloc[0]
    assert (row["cases"], row["right"], row["class"], row["wrong"], row["other"]) == (2, 0, 0.5, 0.5, 0)
    assert row["right_high"] == pytest.approx(beta.ppf(0.975, 1, 2))
    assert set(table["angle_up_to_deg"]) == {5, 10, 90}
