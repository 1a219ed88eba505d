"""The display shows the plan; the flange feels something else."""

import numpy as np
import pinocchio as pin
import pytest

from elastocal_proof.plant.load_cell import LoadCell


@pytest.fixture
def pull(rng):
    """Forces with one row of none, levers, and orientations of the flange."""
    force = 500.0 * rng.standard_normal((5, 3))
    force[2] = 0.0
    lever = np.broadcast_to([0.0, 0.5, 0.0], (5, 3))
    return force, lever, np.array([pin.exp3(v) for v in rng.standard_normal((5, 3))])


@pytest.mark.parametrize("in_flange", [(), ("turn",), ("bias",), ("turn", "bias")])
def test_what_is_felt_is_what_the_cell_would_show_as_planned(pull, in_flange):
    force, _, facing = pull
    cell = LoadCell(0.03, (0.01, -0.02, 0.03), (5.0, -3.0, 2.0), (0.0, 0.0, 0.0), 2e-5, in_flange)
    shown = cell.shown(cell.felt(*pull)[:, :3], facing)
    loaded = force.any(axis=1)
    np.testing.assert_allclose(shown[loaded], force[loaded], atol=1e-9)


def test_a_cell_that_shows_too_much_makes_the_flange_feel_less(pull):
    np.testing.assert_allclose(LoadCell(scale=0.25).felt(*pull), 0.8 * LoadCell().felt(*pull), atol=1e-9)


def test_errors_fixed_in_the_flange_turn_with_it(pull):
    force, _, facing = pull
    turn, bias = np.array([0.01, -0.02, 0.03]), np.array([4.0, -3.0, 2.0])
    felt = LoadCell(bias_N=tuple(bias), in_flange=("bias",)).felt(*pull)[:, :3]
    np.testing.assert_allclose((felt - force)[force.any(axis=1)], -(facing @ bias)[force.any(axis=1)], atol=1e-9)
    felt = LoadCell(turn_rad=tuple(turn), in_flange=("turn",)).felt(*pull)[:, :3]
    wanted = np.einsum("sij,jk,slk,sl->si", facing, pin.exp3(turn), facing, force)
    np.testing.assert_allclose(felt, wanted, atol=1e-9)


def test_a_cell_mounted_askew_turns_the_felt_force_by_its_angle(pull):
    turn = np.array([0.01, -0.02, 0.03])
    np.testing.assert_allclose(LoadCell(turn_rad=tuple(turn)).felt(*pull)[:, :3], pull[0] @ pin.exp3(turn).T, atol=1e-9)


@pytest.mark.parametrize("in_flange", [(), ("shift",), ("turn", "bias")])
def test_a_wrong_application_point_changes_the_moment_alone(pull, in_flange):
    shift = np.array([0.02, -0.01, 0.03])
    force, lever, facing = pull
    felt = LoadCell(shift_m=tuple(shift), in_flange=in_flange).felt(*pull)
    np.testing.assert_allclose(felt[:, :3], force, atol=1e-12)
    np.testing.assert_allclose(
        felt[:, 3:], np.cross(lever + (facing @ shift if "shift" in in_flange else shift), force), atol=1e-9
    )


@pytest.mark.parametrize("mount", ["pull", "flange"])
def test_a_wrong_force_brings_a_wrong_moment_unless_moments_are_measured_too(pull, mount):
    force, lever, _ = pull
    felt = LoadCell(bias_N=(5.0, -3.0, 2.0), mount=mount).felt(*pull)
    np.testing.assert_allclose(felt[:, 3:], np.cross(lever, felt[:, :3] if mount == "pull" else force), atol=1e-9)
