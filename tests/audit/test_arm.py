"""Arms by pinocchio and MuJoCo against each other, closed forms, and the package's own mechanics."""

import numpy as np
import pytest

from elastocal.mechanics.elastostatics import joint_torques, regressor
from elastocal.mechanics.kinematics import jacobians
from elastocal.mechanics.robot_file import robot_from_document
from elastocal_proof.audit.arm import Arm

BEAM = {
    "chain": "Rz(q1) Tx(2.0) [tip]",
    "compliance_urad_per_Nm": [1e-6],
    "links": {"youngs_modulus_GPa": 70, "shear_modulus_GPa": 26, "tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.02}]},
}
CHAINS = {
    "turned": "Rx(90deg) Ty(0.3) Rz(-q1) Rx(-90deg) Tx(0.2) Rz(30deg) Ry(-q2) [A] Tx(-0.5) Rz(q3) Ty(0.4) Rx(-q4) [B]",
    "coupled": "Tz(0.5) Rz(q1) Tx(0.3) Ry(q2) Tz(0.8) [A] Ry(-q2) Ry(q3) Tx(0.9) [B]",
    "on a track": "Tz(0.3) Tx(-q1) Tz(0.5) Rz(q2) Tx(0.3) Ry(q3) Tx(0.7) [A] Ry(q4) Tx(0.6) [B]",
}
WRENCH = np.array([100.0, -200.0, 300.0, 40.0, 50.0, -60.0])


def document(chain):
    count = max(int(word) for word in "1234" if f"q{word})" in chain)
    limits, compliance = [[-180.0, 180.0]] * count, [0.5 + j for j in range(count)]
    return {"name": "arm", "chain": chain, "joint_limits_deg": limits, "compliance_urad_per_Nm": compliance}


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("wrench_at", ["end_effector", "measuring_point"])
def test_pinocchio_and_mujoco_have_the_same_regressor(chain, wrench_at):
    arm = Arm(document(chain), (0.1, -0.05, 0.2))
    angles = np.random.default_rng(1).uniform(-1, 1, arm.joints)
    for point in arm.points:
        one, other = (get(angles, WRENCH, point, wrench_at) for get in (arm.regressor, arm.mujoco_regressor))
        np.testing.assert_allclose(one, other, atol=1e-9)
        assert np.abs(one).max() > 1


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
def test_the_package_has_it_too(chain):
    arm, robot = Arm(document(chain)), robot_from_document(document(chain))
    angles = np.random.default_rng(2).uniform(-1, 1, arm.joints)
    torques = joint_torques(robot.chain, angles, WRENCH, robot.chain.end_effector)
    for point in arm.points:
        expected = regressor(jacobians(robot.chain, angles, robot.chain.point(point)), torques)
        np.testing.assert_allclose(arm.regressor(angles, WRENCH, point, "end_effector"), expected, atol=1e-9)


def test_a_small_load_deflects_by_the_regressor_times_the_compliances():
    arm = Arm(document(CHAINS["turned"]))
    angles = np.array([0.3, -0.7, 0.4, 1.1])
    expected = arm.regressor(angles, 1e-3 * WRENCH, "B", "end_effector") @ arm.compliance
    np.testing.assert_allclose(arm.deflection(angles, 1e-3 * WRENCH, "B", "end_effector"), expected, atol=1e-12)


def test_a_cantilever_bends_by_the_textbook():
    """F L^3 / 3 E I at its tip, which turns by F L^2 / 2 E I."""
    arm = Arm(BEAM)
    second = np.pi * (0.2**4 - 0.16**4) / 64
    down = arm.deflection(np.zeros(1), np.array([0, 0, -100.0, 0, 0, 0]), "tip", "end_effector")
    assert down[2] == pytest.approx(-100 * 8 / (3 * 70e9 * second), rel=1e-6)
    assert down[4] == pytest.approx(100 * 4 / (2 * 70e9 * second), rel=1e-6)
    stiffer = Arm(BEAM, diameter=2.0).deflection(np.zeros(1), np.array([0, 0, -100.0, 0, 0, 0]), "tip", "end_effector")
    assert abs(stiffer[2]) < abs(down[2]) / 8


def test_given_compliances_are_those_of_joints_alone():
    arm = Arm(BEAM)
    load = np.array([0, 100.0, 0, 0, 0, 0])
    assert arm.deflection(np.zeros(1), load, "tip", "end_effector", np.zeros(1)) == pytest.approx(np.zeros(6))
    turned = arm.deflection(np.zeros(1), load, "tip", "end_effector", np.array([1e-6]))
    assert turned[5] == pytest.approx(200e-6)
