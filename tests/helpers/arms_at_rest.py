"""Arms of the simulation in one line, random angles and wrenches, and the equilibrium of
arms under load."""

import re

import numpy as np

from elastocal_proof.plant.arm import build_arm
from elastocal_proof.plant.multibody import (
    EquilibriumProblem,
    Structure,
    build_model,
    solve_equilibrium,
)

STATES = 40


def arm_of(chain, **entries):
    """Build an arm from a chain of drives q1 to qn, with compliances 1 to n µrad/Nm and
    limits of half a turn in either direction."""
    joints = len({*re.findall(r"q\d+", chain)})
    document = {
        "name": "test",
        "chain": chain,
        "compliance_urad_per_Nm": [*range(1, joints + 1)],
    }
    return build_arm(document | {"joint_limits_deg": [[-180, 180]] * joints} | entries)


def driven_to(machine, angles):
    """Return the coordinates of a machine with its drives at some angles and undeflected
    springs."""
    coordinates = np.zeros((len(angles), machine.model.nq))
    coordinates[:, machine.drive] = angles
    return coordinates


def angles_and_wrenches(arm, force=1000.0, seed=0):
    """Draw joint angles within the limits, and wrenches of forces of one size."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(*arm.limits.T, (STATES, arm.joints))
    forces = rng.standard_normal((STATES, 3))
    forces *= force / np.linalg.norm(forces, axis=1, keepdims=True)
    return angles, np.hstack([forces, np.cross([0.0, 0.5, 0.0], forces)])


def at_rest(arm, angles, wrench, structure=None, compliance=None):
    """Build the machine of an arm, and solve for its equilibrium under wrenches."""
    compliance = arm.compliance if compliance is None else compliance
    machine = build_model(arm, structure or Structure())
    growth = np.zeros((len(angles), arm.joints + 1))
    problem = EquilibriumProblem(
        angles,
        growth,
        applied_wrench=lambda rotation: wrench,
        gear_deflection=lambda torque, unloaded: compliance * torque,
    )
    return machine, solve_equilibrium(machine, problem)


def forces_at(machine, angles):
    """Return the forces on the gears and the poses of the measuring points, with the
    drives at some angles and undeflected springs."""
    growth = np.zeros((len(angles), angles.shape[1] + 1))
    force, position, rotation = machine.compute_forces(
        driven_to(machine, angles), growth
    )
    return force[:, machine.gear], position, rotation
