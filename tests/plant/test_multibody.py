"""The compiled model: where its joints, springs, weights and points are, by MuJoCo's kinematics and closed forms."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from arms_at_rest import arm_of
from scipy.integrate import quad

from elastocal_proof.plant.multibody import machine_of
from elastocal_proof.plant.structure import Compensator, Mass, Structure, TaperedTube

TWO = arm_of("Tz(0.4) Rz(q1) Tx(1) [A] Ry(q2) Tx(0.5) [B]")
EVERYTHING = Structure(
    base=(1e-8, 2e-8, 3e-8, 4e-8, 5e-8, 6e-8),
    flange=(1e-9, 2e-9, 3e-9, 4e-9, 5e-9, 6e-9),
    tilt={1: (1e-7, 2e-7), 2: (3e-7, 4e-7)},
    loose=(2,),
    tubes={1: TaperedTube(2e6, 1e6, 3e7, 4e7, 0.2)},
    segments=2,
    compensator=Compensator((0.0, 0.0, -0.3), (0.2, 0.0, 0.0), 1e5, 0.2),
)


def at(machine, **coordinates):
    """MuJoCo's kinematics with some coordinates by their names, all others zero."""
    data = mujoco.MjData(machine.model)
    for name, value in coordinates.items():
        data.qpos[machine.model.joint(name).qposadr[0]] = value
    mujoco.mj_kinematics(machine.model, data)
    return data


def test_a_gear_turns_about_the_axis_of_its_drive():
    machine = machine_of(TWO, Structure())
    both, one = at(machine, drive1=0.3, gear1=0.2, drive2=-1.0, gear2=0.1), at(machine, drive1=0.5, drive2=-0.9)
    np.testing.assert_allclose(both.site_xpos, one.site_xpos, atol=1e-14)
    np.testing.assert_allclose(both.site_xmat, one.site_xmat, atol=1e-14)
    assert [machine.model.joint(int(j)).name for j in machine.gear] == ["gear1", "gear2"]


def test_stiffnesses_in_the_model_are_one_over_the_compliances_and_drives_have_none():
    machine = machine_of(TWO, EVERYTHING, np.array([1e-6, 4e-6]))
    stiffness = machine.model.jnt_stiffness
    np.testing.assert_allclose(stiffness[machine.gear], [1e6, 2.5e5])
    assert not stiffness[machine.drive].any() and not machine.compliance[[*machine.drive, *machine.gear]].any()
    sprung = [index for name, index in machine.springs.items() if not name.startswith("shift")]
    np.testing.assert_allclose(stiffness[sprung] * machine.compliance[sprung], 1.0)
    assert not machine.compliance[[machine.springs["shift2_0"], machine.springs["shift2_1"]]].any()


def test_springs_of_foot_and_flange_are_along_and_about_each_axis_in_order():
    machine = machine_of(TWO, EVERYTHING)
    for where, size in (("base", 1e-8), ("flange", 1e-9)):
        names = [f"{where}_{kind}{axis}" for kind in ("", "r") for axis in "xyz"]
        indices = [machine.springs[name] for name in names]
        np.testing.assert_allclose(machine.compliance[indices], size * np.arange(1, 7))
        assert machine.slides[indices].tolist() == [True] * 3 + [False] * 3
        np.testing.assert_allclose(machine.model.jnt_axis[indices], [*np.eye(3), *np.eye(3)])


def test_bearings_tilt_and_shift_across_the_axis_of_their_joint():
    machine = machine_of(TWO, EVERYTHING)
    for name, axis, compliance in (
        ("tilt1_0", "x", 1e-7),
        ("tilt1_1", "y", 2e-7),
        ("tilt2_0", "x", 3e-7),
        ("tilt2_1", "z", 4e-7),
        ("shift2_0", "x", 0.0),
        ("shift2_1", "z", 0.0),
    ):
        index = machine.springs[name]
        np.testing.assert_array_equal(machine.model.jnt_axis[index], np.eye(3)["xyz".index(axis)])
        assert machine.compliance[index] == pytest.approx(compliance)
    assert "shift1_0" not in machine.springs


def test_a_coordinate_moves_all_that_is_beyond_it_and_nothing_else():
    machine = machine_of(TWO, EVERYTHING)
    model, still = machine.model, at(machine)
    for number in range(model.njnt):
        moved = at(machine, **{model.joint(number).name: 0.01})
        if machine.slides[number]:
            changed = np.abs(moved.xpos - still.xpos).max(axis=1) > 1e-6
        else:
            changed = np.abs(moved.xmat - still.xmat).max(axis=1) > 1e-6
        np.testing.assert_array_equal(changed, machine.beyond[number], err_msg=model.joint(number).name)


@pytest.mark.parametrize("flange", [None, (1e-9,) * 6])
def test_a_load_counts_from_the_flange_and_turns_with_it(flange):
    machine = machine_of(TWO, Structure(payload=Mass(2, 20.0, 1.0, (0.1, 0.0, 0.3)), flange=flange))
    data = at(machine, drive2=0.5 * np.pi)
    body = machine.model.body("flange" if flange else "arm2").id
    # Forearm and flange point down: x of the flange is -z of the base and z is x.
    np.testing.assert_allclose(data.xipos[body], [1.0 + 0.3, 0.0, 0.4 - 0.5 - 0.1], atol=1e-9)


def test_a_load_counts_in_the_axes_of_a_flange_that_is_turned_on_its_link():
    arm = arm_of("Rz(q1) Tx(1) Ry(q2) Tx(0.5) Rx(90deg) [B]")
    model = machine_of(arm, Structure(payload=Mass(2, 20.0, 1.0, (0.1, 0.2, 0.3)))).model
    # y of the flange is z of the link, and z its -y.
    np.testing.assert_allclose(model.body("arm2").ipos, [0.6, -0.3, 0.2], atol=1e-9)


@pytest.mark.parametrize("segments", [1, 4])
def test_a_mass_on_an_elastic_link_stands_where_it_does_on_a_rigid_one(segments):
    masses = (Mass(1, 30.0, 0.0), Mass(1, 20.0, 0.55, (0.0, 0.1, 0.0)), Mass(1, 10.0, 1.0))
    machine = machine_of(TWO, Structure(masses=masses, tubes={1: TaperedTube(1e6, 1e6)}, segments=segments))
    data, weighs = at(machine, drive1=0.3), machine.model.body_mass
    centre = weighs @ data.xipos / weighs.sum()
    wanted = np.array([(20 * 0.55 + 10) / 60, 20 * 0.1 / 60, 0.0])
    np.testing.assert_allclose(centre, [0, 0, 0.4] + pin.exp3(np.array([0, 0, 0.3])) @ wanted, atol=1e-9)
    assert weighs.sum() == pytest.approx(60.0)


def test_a_tube_that_gets_thinner_yields_as_the_integrals_along_it():
    tube, count = TaperedTube(2e6, 1e6, 3e7, 4e7, 0.3), 40
    machine = machine_of(TWO, Structure(tubes={1: tube}, segments=count))

    def total(kind, power=0):
        middle = (np.arange(count) + 0.5) / count
        springs = [machine.compliance[machine.springs[f"link1_{segment}_{kind}"]] for segment in range(count)]
        return np.array(springs) @ (1.0 - middle) ** power

    def integral(stiffness, thinning, power=0):
        return quad(lambda x: (1.0 - x) ** power / (stiffness * (1.0 - 0.3 * x) ** thinning), 0.0, 1.0)[0]

    # The tip under a force across, which bends by its lever squared; E I and G J go with the cube of the width, areas with it.
    for which in (0, 1):
        assert total(f"bend{which}", 2) == pytest.approx(integral(2e6, 3, 2), rel=1e-3)
        assert total(f"shear{which}") == pytest.approx(integral(4e7, 1), rel=1e-3)
    assert total("twist") == pytest.approx(integral(1e6, 3), rel=1e-3)
    assert total("axial") == pytest.approx(integral(3e7, 1), rel=1e-3)


def test_an_elastic_link_that_is_not_loaded_is_as_long_as_a_rigid_one():
    rigid, elastic = (at(machine_of(TWO, s), drive1=0.7, drive2=-0.4) for s in (Structure(), EVERYTHING))
    for point in TWO.points:
        np.testing.assert_allclose(elastic.site(point).xpos, rigid.site(point).xpos, atol=1e-14)
        np.testing.assert_allclose(elastic.site(point).xmat, rigid.site(point).xmat, atol=1e-14)


@pytest.mark.parametrize("tubes", [{}, {1: TaperedTube(1e6, 1e6)}])
def test_wrong_dimensions_are_at_the_far_end_of_their_stretch_and_carry_on(tubes):
    structure = Structure(wrong_vectors_m={1: (0.0, 0.02, 0.0)}, wrong_turns={1: (0.0, 0.0, 0.1)}, tubes=tubes)
    data, turn = at(machine_of(TWO, structure)), pin.exp3(np.array([0.0, 0.0, 0.1]))
    np.testing.assert_allclose(data.site("A").xpos, [1.0, 0.02, 0.4], atol=1e-14)
    np.testing.assert_allclose(data.site("A").xmat.reshape(3, 3), turn, atol=1e-14)
    np.testing.assert_allclose(data.site("B").xpos, [1.0, 0.02, 0.4] + turn @ [0.5, 0.0, 0.0], atol=1e-14)


def test_a_point_inside_a_link_of_wrong_length_keeps_its_place():
    arm = arm_of("Rz(q1) Tx(0.4) [inner] Tx(0.6) Ry(q2) Tx(0.5) [B]")
    data = at(machine_of(arm, Structure(wrong_vectors_m={1: (0.0, 0.02, 0.0)}, wrong_turns={1: (0.0, 0.0, 0.1)})))
    np.testing.assert_allclose(data.site("inner").xpos, [0.4, 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(data.site("inner").xmat.reshape(3, 3), np.eye(3), atol=1e-14)


def test_the_compensators_ends_are_fixed_before_and_behind_the_shoulders_drive():
    machine = machine_of(TWO, replace(EVERYTHING, tubes={}))
    for drive1, drive2 in ((0.0, 0.0), (0.8, 0.0), (0.0, 0.9)):
        data = at(machine, drive1=drive1, drive2=drive2)
        column, shoulder = pin.exp3(np.array([0, 0, drive1])), np.array([0, 0, 0.4])
        shoulder = shoulder + column @ [1.0, 0.0, 0.0]
        np.testing.assert_allclose(data.site("anchor").xpos, shoulder + column @ [0, 0, -0.3], atol=1e-14)
        crank = column @ pin.exp3(np.array([0, drive2, 0])) @ [0.2, 0, 0]
        np.testing.assert_allclose(data.site("crank").xpos, shoulder + crank, atol=1e-14)
