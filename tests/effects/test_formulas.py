"""The formula of an effect gives what its law gives."""

from dataclasses import replace

import numpy as np
import pytest
from made_models import equip
from synthetic import make_states

from elastocal.effects.catalogue import candidates_on
from elastocal.effects.conditions import build_conditions
from elastocal.effects.formulas import (
    LimitedLoad,
    derive_formulas,
    list_terms,
    make_symbolic_angles,
    sum_formulas,
)
from elastocal.errors import InputError
from elastocal.mechanics.sites import build_sites
from elastocal.residual_model.selection import is_commanded


def find_terms(sites, effect, shapes=(), compliance=None):
    """Terms of an effect whose parameters are all one."""
    if compliance is None:
        compliance = np.full(sites.joints, 1e-6)
    formulas = derive_formulas(effect, shapes, sites, compliance, "test")
    return sum_formulas(np.ones(len(formulas)), formulas)


def evaluate(terms, conditions):
    """Displacement of each coordinate, (S, C), by terms without weights."""
    states = len(conditions.joint_angles)
    displaced = np.zeros((states, conditions.sites.chain.coordinates))
    for term in terms:
        phase = np.zeros(states)
        for joint, order in term.orders:
            phase += order * conditions.joint_angles[:, joint]
        value = term.value * getattr(np, term.wave)(phase)
        for joint in term.angles:
            value = value * conditions.joint_angles[:, joint]
        for coordinate in term.loads:
            value = value * conditions.total[:, coordinate]
        if term.limited:
            load = conditions.total[:, term.limited.coordinate]
            limit = term.limited.limit
            if term.limited.kind == "tanh":
                value = value * np.tanh(load / limit)
            else:
                value = value * np.clip(load, -limit, limit)
        assert term.weight is None
        displaced[:, term.coordinate] += value
    return displaced


@pytest.mark.parametrize("name", ["kuka", "gen3"])
def test_terms_of_every_law_without_weights_give_its_displacements(name):
    robot = equip(name)
    sites = build_sites(robot)
    states = make_states(robot.joints, 7)
    conditions = build_conditions(sites, robot.compliance, states)
    tested = 0
    for effect in candidates_on(sites).values():
        if not is_commanded(effect):
            continue
        shapes = [0.4 * shape.lowest + 0.6 * shape.highest for shape in effect.shapes]
        terms = find_terms(sites, effect, shapes, robot.compliance)
        if any(term.weight for term in terms):
            continue
        law = np.zeros((len(states), sites.chain.coordinates))
        for functions in effect.displacement(conditions, *shapes):
            for coordinate, values in functions.items():
                law[:, coordinate] += values
        scale = np.abs(law).max()
        np.testing.assert_allclose(
            evaluate(terms, conditions), law, atol=1e-13 * scale, err_msg=effect.key
        )
        tested += 1
    assert tested > 150


def test_a_play_is_a_saturated_load(kuka):
    sites = build_sites(kuka)
    effect = candidates_on(sites)["lost_motion@2"]
    (term,) = find_terms(sites, effect, [50.0])
    assert term.coordinate == 1 and term.limited == LimitedLoad("tanh", 1, 50.0)


def test_a_payload_is_one_weight_of_each_joint(kuka):
    sites = build_sites(kuka)
    terms = find_terms(sites, candidates_on(sites)["payload"])
    assert [term.weight.joint for term in terms] == [*range(6)]
    assert {term.weight.after for term in terms} == {sites.tracked_points[7].after}
    assert terms[1].weight.moment == pytest.approx((1e-6, 1e-6, 1e-6))


def test_products_of_waves_are_waves_and_powers_of_angles_are_kept():
    first, second = make_symbolic_angles(2)[0]
    terms = list(list_terms(0, first.sin() * second.cos() + 3.0 * first**2))
    waves = {(t.wave, t.orders): t.value for t in terms if not t.angles}
    assert waves == {
        ("sin", ((0, 1.0), (1, 1.0))): pytest.approx(0.5),
        ("sin", ((0, 1.0), (1, -1.0))): pytest.approx(0.5),
    }
    (square,) = [term for term in terms if term.angles]
    assert (square.angles, square.value) == ((0, 0), 3.0)


@pytest.mark.parametrize(
    "turn",
    [
        lambda around: np.arctan(around.joint_angles[:, 0]),
        lambda around: np.abs(around.joint_angles[:, 0]),
        lambda around: np.where(around.total[:, 0] > 0.0, 1.0, 0.0),
        lambda around: np.sqrt(around.joint_angles[:, 0]),
        lambda around: 1.0 / around.joint_angles[:, 0],
        lambda around: np.tanh(around.total[:, 0]) * np.tanh(around.total[:, 1]),
        lambda around: np.tanh(around.joint_angles[:, 0]),
        lambda around: around.wrench[:, 0],
    ],
)
def test_another_law_is_refused_in_a_line_with_its_name(kuka, turn):
    sites = build_sites(kuka)
    effect = replace(
        candidates_on(sites)["joint_offset@2"],
        displacement=lambda around: [{0: turn(around)}],
    )
    with pytest.raises(InputError, match=r"joint_offset@2.*no formula") as refusal:
        find_terms(sites, effect)
    assert "\n" not in str(refusal.value)


def test_hoses_of_the_contribution_guide_have_a_formula(kuka):
    """A law of a plug-in needs nothing else."""
    sites = build_sites(kuka)
    effect = replace(
        candidates_on(sites)["joint_offset@2"],
        displacement=lambda around: [{1: around.joint_angles[:, 1] ** 3}],
    )
    (term,) = find_terms(sites, effect)
    assert (term.coordinate, term.angles, term.value) == (1, (1, 1, 1), 1.0)
