"""Effects that are linear in the load: by beams, moments carried to a joint by hand, and the reciprocity of elastic bodies."""

import numpy as np
import pytest
from scipy.integrate import quad
from support import OTHER_CHAINS, PinocchioPoint, chain_of
from synthetic import candidate_on, conditions_on, displacements, made_states

from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.elastostatics import generalized_forces
from elastocal.mechanics.kinematics import poses, poses_and_jacobians
from elastocal.mechanics.links import extended_chain, tube_compliance
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


def behind_joint(chain, joint):
    """A point just behind a joint of the robot's own chain."""
    place = next(index for index, t in enumerate(chain.transforms) if t.coordinate == joint)
    return MeasuringPoint("behind", place + 1)


def wrench_at(chain, states, point):
    """Force and moment of the load at another point, along the axes there: carried over by hand."""
    end = poses(chain, states.joint_angles, MeasuringPoint("end", chain.end_effector.after))[0]
    position, rotation = poses(chain, states.joint_angles, point)
    force, moment = states.wrench[:, :3], states.wrench[:, 3:]
    moment = moment + np.cross(end - position, force)
    return np.concatenate([np.einsum("sij,si->sj", rotation, vector) for vector in (force, moment)], axis=1)


def joint_torques_by_pinocchio(chain, states):
    model = PinocchioPoint(chain, chain.end_effector)
    jacobians = [model.pose_and_jacobian(q)[2] for q in states.joint_angles]
    return np.array([jacobian.T @ wrench for jacobian, wrench in zip(jacobians, states.wrench, strict=True)])


def test_link_elasticity_is_the_extended_model_without_its_stretching(kuka_extended):
    states = made_states(6, 5, seed=1)
    around = conditions_on(kuka_extended.chain, states)
    chain = extended_chain(kuka_extended)
    coordinates = np.concatenate([states.joint_angles, np.zeros((5, 30))], axis=1)
    load = generalized_forces(poses_and_jacobians(chain, coordinates, chain.end_effector)[2], states.wrench)
    for number, link in {0: 0, 1: 1, 2: 2, 3: 3, 4: 6}.items():
        tube = kuka_extended.links[number].tube
        outer, inner = tube.outer_diameter_m, tube.outer_diameter_m - 2 * tube.wall_m
        second = np.pi * (outer**4 - inner**4) / 64
        vector = np.array(kuka_extended.links[number].vector_m)
        length = np.linalg.norm(vector)
        x = vector / length
        y = np.cross(x, [0.3, 0.5, 0.7]) / np.linalg.norm(np.cross(x, [0.3, 0.5, 0.7]))
        axes = np.kron(np.eye(2), np.column_stack([x, y, np.cross(x, y)]))
        beam = tube_compliance(tube, length)
        beam[0, 0] = 0.0
        spring = axes @ beam @ axes.T
        expected = load[:, 6 + 6 * number : 12 + 6 * number] @ spring.T
        made = displacements(
            candidate_on(kuka_extended.chain, f"link_elasticity@{link}" if link else "link_elasticity[column]"), around, 0.0
        )
        total = made[0] / (tube.youngs_modulus_Pa * second) + made[1] / (tube.shear_modulus_Pa * 2 * second)
        found = total[:, list(around.sites.link_end[link])]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        assert not np.delete(total, list(around.sites.link_end[link]), axis=1).any()


def test_links_bend_by_the_formulas_of_the_cantilever():
    # y = F l^3 / 3EI, turn F l^2 / 2EI; a moment: M l^2 / 2EI and M l / EI; a twist: M l / GJ.
    chain = chain_of("Rz(q1) Tx(2) [end]")
    states = made_states(1, 4)
    states.joint_angles[:] = 0.0
    states.wrench[:] = [[0, 10, 0, 0, 0, 0], [0, 0, 10, 0, 0, 0], [0, 0, 0, 3, 0, 5], [7, 0, 0, 0, 0, 0]]
    around = conditions_on(chain, states)
    made = displacements(candidate_on(chain, "link_elasticity@1"), around, 0.0)[..., list(around.sites.link_end[1])]
    bent = [
        [0, 10 * 8 / 3, 0, 0, 0, 10 * 4 / 2],
        [0, 0, 10 * 8 / 3, 0, -10 * 4 / 2, 0],
        [0, 5 * 4 / 2, 0, 0, 0, 5 * 2],
        [0] * 6,
    ]
    np.testing.assert_allclose(made[0], bent, atol=1e-13)
    twisted = np.zeros((4, 6))
    twisted[2, 3] = 3 * 2
    np.testing.assert_allclose(made[1], twisted, atol=1e-13)


@pytest.mark.parametrize("taper", [0.0, 0.3, 0.6])
def test_links_that_get_thinner_bend_as_the_equation_of_the_beam_integrated(taper):
    """EI and GJ of a thin wall go with the cube of the diameter: curvature and twist, integrated twice and once."""
    length = 2.0
    chain = chain_of("Rz(q1) Tx(2) [end]")
    states = made_states(1, 3)
    states.joint_angles[:] = 0.0
    states.wrench[:] = [[0, 10, 0, 0, 0, 0], [0, 0, 0, 0, 0, 5], [0, 0, 0, 3, 0, 0]]
    around = conditions_on(chain, states)
    made = displacements(candidate_on(chain, "link_elasticity@1"), around, taper)[..., list(around.sites.link_end[1])]

    def softer(place):
        return (1 - taper * place / length) ** -3

    # Sized by the uniform link that bends under a force, and twists, as far.
    bends, twists = (quad(lambda place, p=p: (length - place) ** p * softer(place), 0, length)[0] for p in (2, 0))
    bends, twists = length**3 / 3 / bends, length / twists

    for number, moment in enumerate((lambda place: 10 * (length - place), lambda place: 5.0)):
        turn = quad(lambda place, moment=moment: moment(place) * softer(place), 0, length)[0]
        shift = quad(lambda place, moment=moment: (length - place) * moment(place) * softer(place), 0, length)[0]
        np.testing.assert_allclose(made[0, number], bends * np.array([0, shift, 0, 0, 0, turn]), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(made[1, 2], [0, 0, 0, 3 * twists * quad(softer, 0, length)[0], 0, 0], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("name", ["fanuc", *OTHER_CHAINS])
def test_links_that_bend_are_those_with_a_length(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    lengths = np.linalg.norm(sites_of(chain).link_vectors_m, axis=1)
    found = {c.key for c in candidates_on(sites_of(chain)).values() if c.effect == "link_elasticity"}
    long = [link for link in range(1, len(lengths)) if lengths[link] > 0.05]
    column = {"link_elasticity[column]"} if lengths[0] > 0.05 else set()
    together = f"link_elasticity@{'+'.join(map(str, long))}[one section]"
    assert found == {*(f"link_elasticity@{link}" for link in long), *column, together}


def test_links_of_one_section_bend_all_as_each_by_itself(fanuc):
    around = conditions_on(fanuc.chain, made_states(6, 5, seed=10))
    known = candidates_on(around.sites)
    each = [known[key] for key in ("link_elasticity[column]", *(f"link_elasticity@{link}" for link in (1, 2, 3, 6)))]
    found = displacements(known["link_elasticity@1+2+3+6[one section]"], around, 0.2)
    np.testing.assert_allclose(found, sum(displacements(candidate, around, 0.2) for candidate in each), rtol=1e-12)


@pytest.mark.parametrize("name", ["fanuc", *OTHER_CHAINS])
def test_tilt_is_the_moment_at_the_joint_across_its_axis(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=2)
    around = conditions_on(chain, states)
    for joint in range(chain.coordinates):
        candidate = candidate_on(chain, f"joint_tilt@{joint + 1}")
        moment = wrench_at(chain, states, behind_joint(chain, joint))[:, 3:]
        own = next(t.axis for t in chain.transforms if t.coordinate == joint)
        across = [axis for axis in range(3) if axis != own]
        assert [p.name[-1] for p in candidate.parameters] == ["xyz"[axis] for axis in across]
        made = displacements(candidate, around)
        for column, axis in zip(made, across, strict=True):
            expected = np.zeros_like(column)
            expected[:, around.sites.tilt[joint][axis]] = moment[:, axis]
            np.testing.assert_allclose(column, expected, rtol=0, atol=1e-10)


def test_tilt_of_a_bearing_drops_the_end_of_an_arm_as_calculated_by_hand():
    # 100 N down at 2 m: 200 N m about y at the bearing, 1e-6 rad/(N m) gives 0.2 mrad and 0.4 mm.
    chain = chain_of("Tz(1) Rz(q1) Tx(2) [end]")
    states = made_states(1, 1)
    states.joint_angles[:], states.wrench[:] = 0.0, [[0, 0, -100, 0, 0, 0]]
    around = conditions_on(chain, states)
    made = 1e-6 * displacements(candidate_on(chain, "joint_tilt@1"), around)
    end = around.sites.chain.end_effector
    jacobian = poses_and_jacobians(around.sites.chain, np.zeros(around.sites.chain.coordinates), end)[2]
    np.testing.assert_allclose(made[:, 0] @ jacobian.T, [[0] * 6, [0, 0, -4e-4, 0, 2e-4, 0]], atol=1e-18)


def test_base_gives_under_the_force_and_the_tilting_moment_at_the_foot(fanuc):
    states = made_states(6, 5, seed=3)
    around = conditions_on(fanuc.chain, states)
    end = poses(fanuc.chain, states.joint_angles, fanuc.chain.end_effector)[0]
    force = states.wrench[:, :3]
    moment = states.wrench[:, 3:] + np.cross(end, force)
    expected = np.zeros((3, 5, 6))
    expected[0, :, :2], expected[1, :, 2], expected[2, :, 3:5] = force[:, :2], force[:, 2], moment[:, :2]
    made = displacements(candidate_on(fanuc.chain, "base_compliance"), around)
    np.testing.assert_allclose(made[..., list(around.sites.base)], expected, rtol=0, atol=1e-11)
    assert not np.delete(made, list(around.sites.base), axis=2).any()


@pytest.mark.parametrize("name", ["fanuc", "ur10", "fixed rotations"])
def test_cross_compliance_turns_each_joint_by_the_torque_of_the_other(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=4)
    around, torque = conditions_on(chain, states), joint_torques_by_pinocchio(chain, states)
    pairs = [c for c in candidates_on(around.sites).values() if c.effect == "cross_compliance"]
    assert len(pairs) == chain.coordinates * (chain.coordinates - 1) // 2
    for candidate in pairs:
        one, other = (joint - 1 for joint in candidate.joints)
        expected = np.zeros_like(around.load)
        expected[:, one], expected[:, other] = torque[:, other], torque[:, one]
        np.testing.assert_allclose(displacements(candidate, around)[0], expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["fanuc", "fixed rotations"])
def test_joint_dependent_stiffness_is_the_torque_times_cosine_and_sine(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=5)
    around, torque = conditions_on(chain, states), joint_torques_by_pinocchio(chain, states)
    for joint in range(chain.coordinates):
        made = displacements(candidate_on(chain, f"joint_dependent_stiffness@{joint + 1}"), around)
        for column, wave in zip(made, (np.cos, np.sin), strict=True):
            expected = np.zeros_like(column)
            expected[:, joint] = torque[:, joint] * wave(states.joint_angles[:, joint])
            np.testing.assert_allclose(column, expected, rtol=0, atol=1e-10)


def test_compensator_stiffens_the_shoulder_as_an_angle_dependent_stiffness_would_and_by_twice_the_angle(fanuc):
    states = made_states(6, 5, seed=6)
    around = conditions_on(fanuc.chain, states)
    ours, alias = (candidate_on(fanuc.chain, f"{name}@2") for name in ("compensator_stiffness", "joint_dependent_stiffness"))
    made = displacements(ours, around)
    np.testing.assert_array_equal(made[:2], displacements(alias, around))
    for column, wave in zip(made[2:, :, 1], (np.cos, np.sin), strict=True):
        np.testing.assert_allclose(column, around.total[:, 1] * wave(2 * states.joint_angles[:, 1]), rtol=1e-12)
    assert ours.key == "compensator_stiffness@2" and ours.family == "elastic"


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


@pytest.mark.parametrize("effect", ["link_elasticity", "joint_tilt", "base_compliance", "flange_flexibility"])
def test_loads_do_work_on_what_gives_way(effect, fanuc):
    around = conditions_on(fanuc.chain, made_states(6, 30, seed=9))
    for candidate in candidates_on(around.sites).values():
        if candidate.effect == effect:
            made = displacements(candidate, around, *[shape.start for shape in candidate.shapes])
            assert ((made * around.load).sum(axis=2) >= 0).all()


@pytest.mark.parametrize("name", ["fanuc", "ur10", "fixed rotations"])
def test_flange_gives_under_the_load_seen_along_its_axes(name, fanuc):
    chain = fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])
    states = made_states(chain.coordinates, 5, seed=11)
    around = conditions_on(chain, states)
    seen = wrench_at(chain, states, MeasuringPoint("end", chain.end_effector.after))
    made = displacements(candidate_on(chain, "flange_flexibility"), around)
    for number, coordinate in enumerate(around.sites.link_end[-1]):
        expected = np.zeros_like(made[number])
        expected[:, coordinate] = seen[:, number]
        np.testing.assert_allclose(made[number], expected, rtol=0, atol=1e-10)
