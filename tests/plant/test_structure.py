"""What an arm has beside its drives where nothing is stated."""

import numpy as np
from arms_at_rest import angles_and_wrenches, at_rest, loading_of

from elastocal_proof.plant.multibody import machine_of
from elastocal_proof.plant.statics import generalized_forces
from elastocal_proof.plant.structure import Mass, Structure, TaperedTube


def test_by_default_an_arm_has_drives_and_gears_alone_and_no_weight(fanuc_arm):
    machine = machine_of(fanuc_arm, Structure())
    assert machine.model.nq == 12 and not machine.springs
    assert machine.model.body_mass.sum() < 1e-9
    assert machine.model.ntendon == 0


def test_weight_pulls_downwards_with_standard_gravity(fanuc_arm):
    machine, rest = at_rest(fanuc_arm, *(a[:1] * 0.0 for a in angles_and_wrenches(fanuc_arm)), Structure(payload=Mass(6, 10.0)))
    np.testing.assert_allclose(machine.model.opt.gravity, [0.0, 0.0, -9.80665])
    # Stretched out forwards the load hangs l3 + l5 + l6 before the shoulder, which pulls it down: a positive turn about y.
    torque = generalized_forces(machine, rest.coordinates * 0.0, loading_of(np.zeros((1, 6))))[0][0, machine.gear]
    np.testing.assert_allclose(torque[[0, 1]], [0.0, 10.0 * 9.80665 * (1.075 + 1.280 + 0.215)], atol=1e-9)


def test_a_tube_bends_and_twists_and_by_default_does_not_stretch_shear_or_get_thinner(fanuc_arm):
    machine = machine_of(fanuc_arm, Structure(tubes={2: TaperedTube(2e6, 1e6)}, segments=3))
    assert {name.split("_", 2)[2] for name in machine.springs} == {"bend0", "bend1", "twist"}
    bends = [machine.compliance[machine.springs[f"link2_{segment}_bend0"]] for segment in range(3)]
    np.testing.assert_allclose(bends, 1.075 / 3 / 2e6)


def test_a_mass_stands_in_the_middle_of_its_stretch_unless_placed(fanuc_arm):
    model = machine_of(fanuc_arm, Structure(masses=(Mass(2, 40.0),))).model
    np.testing.assert_allclose(model.body("arm2").ipos, 0.5 * fanuc_arm.stretches[2].vector_m, atol=1e-12)


def test_two_structures_share_no_springs_of_theirs():
    one, other = Structure(), Structure()
    one.tilt[1] = (1e-7, 1e-7)
    assert not other.tilt and not other.tubes and not other.wrong_turns
