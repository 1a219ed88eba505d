"""Models of a robot with effects of the catalogue, simulated measurements of them, and
a gantry whose estimation problem is exactly linear."""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from support import chain_of
from synthetic import (
    add_noise,
    find_candidate,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.campaigns.campaign import Target
from elastocal.effects.protocol import Candidate, Parameter
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import Observations

TARGETS = Target("A", "6DoF", None), Target("B", "3DoF", None)


def build_model(robot, *keys, targets=TARGETS[:1], **options):
    """Build a model of a robot with its nominal compliances and the candidates of the
    catalogue that have these keys; it has one target by default."""
    effects = tuple(find_candidate(robot.chain, key) for key in keys)
    return make_model(
        robot.chain, targets, effects=effects, compliance=robot.compliance, **options
    )


def list_held_parameters(fit):
    """Return owner and name of each parameter that a fit held fixed."""
    return [
        f"{owner} {parameter.name}"
        for (owner, parameter), held in zip(
            fit.parameters, fit.unidentifiable, strict=True
        )
        if held
    ]


def observe_bent_law(fanuc, seed, shape, key="thermal_growth[time]"):
    """Simulate noisy measurements of an effect whose shape parameter has a given value.

    Returns the model that made the measurements, and the observations.
    """
    model = build_model(fanuc, key)
    true = replace(make_estimate(model, seed=seed), shapes=(np.array([shape]),))
    states = make_states(6, 30, seed=seed, force=300.0)
    observations = observe_exactly(model, true, states)
    return model, add_noise(observations, np.random.default_rng(seed))


# The joints of a gantry are the coordinates of its hand. A basis function that shifts
# the joints is therefore exactly linear, and a joint error is a position error.
GANTRY = "Tx(q1) Ty(q2) Tz(q3) [hand]"
GANTRY_NOISES = {
    "sensor": Noise("declared", 1e-4, 1e-4, np.zeros(3)),
    "joints": Noise("repeats", 1e-4, 1e-4, np.array([2e-4, 0.0, 5e-5])),
    "poses": Noise("repeats", 1e-4, 1e-4, np.array([2e-4, 0.0, 5e-5]), pose_rad=1.5e-4),
}


def evaluate_waves(joint_angles, count, seed=0):
    """Evaluate basis functions that are smooth in the joint angles and of similar size:
    ndarray (S, 3, count)."""
    rng = np.random.default_rng((90, seed))
    frequencies = rng.uniform(0.5, 3.0, (3, count, joint_angles.shape[1]))
    phases = rng.uniform(0, 2 * np.pi, (3, count))
    return np.sin(np.einsum("icj,sj->sic", frequencies, joint_angles) + phases)


def make_linear_law(count, priors=None, plausible=0.1, seed=0):
    """Make an effect with `count` parameters that shifts the three joints of the gantry
    by `evaluate_waves`."""
    priors = [None] * count if priors is None else priors
    parameters = tuple(
        Parameter(f"p{number}", "m", plausible, prior)
        for number, prior in enumerate(priors)
    )

    def displacement(conditions):
        columns = evaluate_waves(conditions.joint_angles, count, seed)
        x, y, z = np.moveaxis(columns, 1, 0)
        return [
            {0: x[:, number], 1: y[:, number], 2: z[:, number]}
            for number in range(count)
        ]

    return Candidate("made_law", "made", (1,), "", parameters, displacement)


def make_gantry_model(*effects, rows=3):
    """Make a model of the gantry with these effects; its base frame and its target are
    known."""
    return make_model(
        chain_of(GANTRY),
        (Target("A", "hand", (0.0, 0.0, 0.0)),),
        rows,
        fitted_frames=False,
        effects=effects,
    )


def make_gantry_states(count, poses=None, seed=0):
    """Make unloaded states of the gantry, spread evenly over the poses and repeated one
    to four times; every state is a pose by default."""
    states = make_states(3, count, (91, seed), force=0.0)
    return replace(
        states,
        pose=np.arange(count) * (poses or count) // count,
        repeats=np.random.default_rng((92, seed)).integers(1, 5, count),
    )


def observe_with_errors(states, error, rotation_vector=None):
    """Observe the gantry at its commanded positions plus an error, (S, 3) in m, and in
    the orientations of rotation vectors, (S, 3) in rad."""
    rotation = None
    if rotation_vector is not None:
        rotation = Rotation.from_rotvec(rotation_vector).as_matrix()
    count = len(states)
    return Observations(
        states,
        np.arange(count),
        np.zeros(count, int),
        states.joint_angles + error,
        rotation,
    )


def compute_gantry_covariance(states, noise):
    """Write out the covariance of all positions of the gantry, whose Jacobian is the
    identity."""
    single = noise.position_m**2 * np.eye(3) + np.diag(noise.joint_rad**2)
    of_states = block_diag(*(single / repeats for repeats in states.repeats))
    pose = np.repeat(states.pose, 3)
    axis = np.tile(np.arange(3), len(states))
    same_pose = pose[:, None] == pose
    same_axis = axis[:, None] == axis
    return of_states + noise.pose_rad**2 * same_pose * same_axis
