"""Effects that are linear in the load, beyond their closed forms: where they act, and that elastic bodies are reciprocal."""

import numpy as np
import pytest
from support import ODD_CHAINS, OTHER_CHAINS, chain_of, robot_of
from synthetic import conditions_on, displacements, made_estimate, made_model, made_states

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.elastic import joint_compliance
from elastocal.fitting.model import conditions, displaced_coordinates
from elastocal.mechanics.sites import sites_of

LINEAR = (
    "link_elasticity",
    "joint_tilt",
    "base_compliance",
    "cross_compliance",
    "joint_dependent_stiffness",
    "compensator_stiffness",
    "flange_flexibility",
)


@pytest.mark.parametrize("name", ["fanuc", *OTHER_CHAINS])
def test_links_that_bend_are_those_with_a_length(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    lengths = np.linalg.norm(sites_of(chain).link_vectors_m, axis=1)
    found = {c.key for c in candidates_on(sites_of(chain)).values() if c.effect == "link_elasticity"}
    long = [link for link in range(1, len(lengths)) if lengths[link] > 0.05]
    column = {"link_elasticity[column]"} if lengths[0] > 0.05 else set()
    together = f"link_elasticity@{'+'.join(map(str, long))}[one section]"
    assert found == {*(f"link_elasticity@{link}" for link in long), *column, together}


@pytest.mark.parametrize("effect", LINEAR)
@pytest.mark.parametrize("name", ["fanuc", "ur10", "seven joints"])
def test_elastic_effects_are_reciprocal(effect, name, fanuc):
    """Betti: the work of one load on the displacement by another is that of the other on the displacement by the one."""
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    one, other = made_states(chain.coordinates, 5, seed=7), made_states(chain.coordinates, 5, seed=7)
    other.wrench[:] = np.random.default_rng(8).standard_normal((5, 6))
    first, second = conditions_on(chain, one), conditions_on(chain, other)
    for candidate in candidates_on(first.sites).values():
        if candidate.effect == effect:
            start = [shape.start for shape in candidate.shapes]
            there = (displacements(candidate, first, *start) * second.load).sum(axis=2)
            back = (displacements(candidate, second, *start) * first.load).sum(axis=2)
            np.testing.assert_allclose(there, back, rtol=1e-9, atol=1e-9)
            assert np.abs(there).max() > 0


def test_carriage_yields_to_the_force_along_its_track():
    robot = robot_of(ODD_CHAINS["track"], [1e-8, 1e-6, 1e-6, 1e-6])
    model = made_model(robot, (Target("A", "hand", (0, 0, 0)),), fitted_frames=False, compliance=robot.compliance)
    states = made_states(4, 3, seed=22)
    shifted = displaced_coordinates(model, made_estimate(model), conditions(model, made_estimate(model), states))[:, 0]
    # The carriage runs along -x.
    np.testing.assert_allclose(shifted - states.joint_angles[:, 0], -1e-8 * states.wrench[:, 0], rtol=1e-9)
    assert [p.unit for p in joint_compliance(model.sites).parameters] == ["m/N", *["rad/(N m)"] * 3]
