"""What an arm has beside its drives where nothing is stated."""

import numpy as np
from arms_at_rest import angles_and_wrenches, at_rest, loading_of

from elastocal_proof.plant.multibody import machine_of
from elastocal_proof.plant.statics import generalized_forces
from elastocal_proof.plant.structure import Mass, Structure, TaperedTube


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
