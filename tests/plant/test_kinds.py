"""Defects as a whole: each kind changes the measurements as its size says, by its seed,
where it is put and nowhere else."""

from dataclasses import replace

import pytest
from catalogue_lists import has_own_test

from elastocal.effects.catalogue import list_bundled_effects
from elastocal_proof.plant.kinds import KINDS, OUTSIDE, apply_defects, draw_defect

NAMED = sorted(kind for kind in KINDS if not kind.startswith(OUTSIDE))


def test_every_effect_of_the_catalogue_can_be_a_defect():
    # A base that stands elsewhere than declared is none of the robot: the tracker of a
    # setting sees it there.
    effects = list_bundled_effects()
    assert {*NAMED, "base_placement"} <= set(effects)
    # The blind proof has no defect of a new effect until the plant has its law.
    for name in set(effects) - {*NAMED, "base_placement"}:
        assert has_own_test(effects[name]), name
    # Else what the catalogue finds rightly would count as a wrong name.
    assert not {kind.removeprefix(OUTSIDE) for kind in set(KINDS) - set(NAMED)} & set(
        list_bundled_effects()
    )


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_defect_of_no_size_leaves_the_robot_as_it_was_and_a_plausible_one_does_not(
    yardstick, fanuc_specimen, kind
):
    defect = draw_defect(kind, fanuc_specimen.arm, 3)
    tiny = replace(defect, size=1e-9 * defect.size)
    small, signal = (
        yardstick.compute_noncentralities(apply_defects(fanuc_specimen, [each]))
        for each in (tiny, defect)
    )
    assert (
        small["raw"] < 1e-9
        and signal["raw"] > 0.1
        and 0 <= signal["retained"] <= signal["raw"] * (1 + 1e-9)
    )


def test_weight_is_of_the_upper_arm_of_the_forearm_or_of_all_links_by_the_joints_that_it_turns(
    fanuc_arm,
):
    upper, fore, everything = KINDS["link_weight"].locations(fanuc_arm)
    assert upper == (2,) and fore == (2, 3) and everything == (2, 3, 4, 5)
