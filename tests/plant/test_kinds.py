"""Every kind of defect changes the measurements according to its size, at its location
only."""

from dataclasses import replace

import pytest
from catalogue_lists import has_own_test

from elastocal.effects.catalogue import list_bundled_effects
from elastocal_proof.plant.kinds import KINDS, OUTSIDE, apply_defects, draw_defect

CATALOGUED = {kind for kind in KINDS if not kind.startswith(OUTSIDE)}
# A base that stands elsewhere than declared is no defect of the robot. The tracker of a
# setting observes it there.
SIMULATED_EFFECTS = CATALOGUED | {"base_placement"}


def test_every_effect_of_the_catalogue_can_be_a_defect():
    effects = list_bundled_effects()
    assert set(effects) >= SIMULATED_EFFECTS
    # The blind benchmark has no defect of a new effect until the simulation has its law.
    for name in set(effects) - SIMULATED_EFFECTS:
        assert has_own_test(effects[name]), name


def test_no_defect_outside_the_catalogue_has_the_name_of_an_effect():
    # Otherwise a correct finding would count as a wrong name.
    outside = {kind.removeprefix(OUTSIDE) for kind in set(KINDS) - CATALOGUED}
    assert not outside & set(list_bundled_effects())


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_plausible_defect_is_visible_and_a_tiny_one_is_not(
    noncentrality, fanuc_specimen, kind
):
    defect = draw_defect(kind, fanuc_specimen.arm, 3)
    tiny_defect = replace(defect, size=1e-9 * defect.size)
    tiny, plausible = (
        noncentrality.compute_noncentralities(apply_defects(fanuc_specimen, [applied]))
        for applied in (tiny_defect, defect)
    )
    assert tiny["raw"] < 1e-9
    assert plausible["raw"] > 0.1
    assert 0 <= plausible["retained"] <= plausible["raw"] * (1 + 1e-9)


def test_weights_that_load_different_joints_are_upper_arm_forearm_and_all_links(
    fanuc_arm,
):
    locations = KINDS["link_weight"].locations(fanuc_arm)
    assert locations == [(2,), (2, 3), (2, 3, 4, 5)]
