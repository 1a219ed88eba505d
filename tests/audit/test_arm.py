"""Arms by pinocchio against closed forms, and the package's own mechanics."""

import numpy as np
import pytest
from scipy.integrate import quad
from support import TRACK, TURNED

from elastocal.mechanics.elastostatics import build_regressor, compute_joint_torques
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.mechanics.robot_file import parse_robot
from elastocal_proof.audit.arm import Arm, compute_link_compliance

BEAM = {
    "chain": "Rz(q1) Tx(2.0) [tip]",
    "compliance_urad_per_Nm": [1e-6],
    "links": {
        "youngs_modulus_GPa": 70,
        "shear_modulus_GPa": 26,
        "tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.02}],
    },
}
WRENCH = np.array([100.0, -200.0, 300.0, 40.0, 50.0, -60.0])


@pytest.mark.parametrize("chain", [TURNED, TRACK])
def test_pinocchio_gives_the_regressor_of_the_package(chain):
    joints = 4
    # A prismatic joint takes them as metres.
    limits = [[-90.0, 90.0]] * joints
    compliance = [0.5 + j for j in range(joints)]
    document = {
        "name": "arm",
        "chain": chain,
        "joint_limits_deg": limits,
        "compliance_urad_per_Nm": compliance,
    }
    arm = Arm(document)
    robot = parse_robot(document)
    angles = np.random.default_rng(2).uniform(-1, 1, arm.joints)
    torques = compute_joint_torques(
        robot.chain, angles, WRENCH, robot.chain.end_effector
    )
    for point in arm.points:
        expected = build_regressor(
            compute_jacobians(robot.chain, angles, robot.chain.point(point)), torques
        )
        np.testing.assert_allclose(
            arm.regressor(angles, WRENCH, point), expected, atol=1e-9
        )
        assert np.abs(expected).max() > 1


def test_a_target_with_an_offset_moves_with_its_point():
    arm = Arm({"chain": "Rz(q1) Tx(2.0) [tip]"}, {"t": ("tip", [0.0, 0.5, 0.0])})
    np.testing.assert_allclose(
        arm.pose(np.array([np.pi / 2]), "t")[0], [-0.5, 2.0, 0.0], atol=1e-15
    )
    np.testing.assert_allclose(arm.jacobian(np.zeros(1), "t")[:2, 0], [-0.5, 2.0])
    np.testing.assert_allclose(arm.jacobian(np.zeros(1))[:2, 0], [0.0, 2.0])


def test_a_tube_bends_by_the_textbook_formulas():
    """The tip shifts by F L^3 / 3 E I, turns by F L^2 / 2 E I, and yields by F L / E A
    along the tube."""
    springs = Arm(BEAM).springs[1:, 1:]
    second_moment = np.pi * (0.2**4 - 0.16**4) / 64
    assert springs[2, 2] == pytest.approx(8 / (3 * 70e9 * second_moment))
    assert springs[4, 2] == pytest.approx(-4 / (2 * 70e9 * second_moment))
    assert springs[0, 0] == pytest.approx(2 / (70e9 * np.pi * (0.1**2 - 0.08**2)))
    assert springs[3, 3] == pytest.approx(2 / (26e9 * 2 * second_moment))


def test_a_tapered_link_bends_by_the_integral_of_its_compliance():
    """By a lateral force it shifts, and by a moment along it twists, as far as the
    uniform link; by a bending moment it turns by the integral of its compliance."""
    taper = 0.4
    uniform, tapered = (
        compute_link_compliance(np.array([2.0, 0, 0]), 1e-6, 2e-6, share)
        for share in (0.0, taper)
    )
    assert tapered[2, 2] == pytest.approx(uniform[2, 2]) and tapered[
        3, 3
    ] == pytest.approx(uniform[3, 3])
    # Integrate (1 - s)^2 / (1 - t s)^3 and 1 / (1 - t s)^3 from 0 to 1; the second has
    # a closed form.
    shifting = quad(lambda s: (1 - s) ** 2 / (1 - taper * s) ** 3, 0, 1)[0]
    assert tapered[5, 5] == pytest.approx(
        2e-6 * ((1 - taper) ** -2 - 1) / (2 * taper) / (3 * shifting)
    )


def test_a_joint_yields_to_the_load_at_its_deflected_pose():
    arm = Arm({"chain": "Rz(q1) Tx(2.0) [tip]"})
    coordinates, forces = arm.deflect(
        np.array([[1e-4]]), np.zeros(1), np.array([0, 1000.0, 0, 0, 0, 0]), 6
    )
    np.testing.assert_allclose(coordinates, 1e-4 * forces, rtol=1e-6)
    # At the deflected pose the lever is shorter than at the commanded pose, where the
    # torque is force times length.
    assert (
        forces[0] == pytest.approx(2000 * np.cos(coordinates[0]), rel=1e-3)
        and forces[0] < 1990
    )
