"""Arms of the plant in one line; arms at random angles under random forces, and where
they come to rest."""

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


def arm_of(chain, **more):
    """An arm from a chain of drives q1 to qn, of compliances 1 to n, which turn half a
    turn either way."""
    joints = len({*re.findall(r"q\d+", chain)})
    document = {
        "name": "test",
        "chain": chain,
        "compliance_urad_per_Nm": [*range(1, joints + 1)],
    }
    return build_arm(document | {"joint_limits_deg": [[-180, 180]] * joints} | more)


def driven_to(machine, angles):
    """Coordinates of a machine whose drives stand at some angles and whose springs are
    at rest."""
    coordinates = np.zeros((len(angles), machine.model.nq))
    coordinates[:, machine.drive] = angles
    return coordinates


def angles_and_wrenches(arm, force=1000.0, seed=0):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(*arm.limits.T, (STATES, arm.joints))
    push = rng.standard_normal((STATES, 3))
    push *= force / np.linalg.norm(push, axis=1, keepdims=True)
    return angles, np.hstack([push, np.cross([0.0, 0.5, 0.0], push)])


def at_rest(arm, angles, wrench, structure=None, compliance=None):
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
    """On the gears, and poses of the measuring points, where the drives stand at some
    angles and no spring has yielded."""
    growth = np.zeros((len(angles), angles.shape[1] + 1))
    force, position, rotation = machine.compute_forces(
        driven_to(machine, angles), growth
    )
    return force[:, machine.gear], position, rotation
