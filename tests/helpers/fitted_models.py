"""Models of a robot with effects by their keys, measurements of them, and what a fit
does not identify."""

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
    """A model of a robot with its nominal springs and these candidates of the
    catalogue; one target by default."""
    effects = tuple(find_candidate(robot.chain, key) for key in keys)
    return make_model(
        robot.chain, targets, effects=effects, compliance=robot.compliance, **options
    )


def list_held_parameters(found):
    """Owners and names of the parameters that a fit held."""
    return [
        f"{owner} {p.name}"
        for (owner, p), held in zip(found.parameters, found.unidentifiable, strict=True)
        if held
    ]


def observe_bent_law(fanuc, seed, shape, key="thermal_growth[time]"):
    """Noisy measurements of a law with a shape somewhere in its range, and the model
    that made them."""
    model = build_model(fanuc, key)
    true = make_estimate(model, seed=seed)
    true = replace(true, shapes=(np.array([shape]),))
    seen = observe_exactly(model, true, make_states(6, 30, seed=seed, force=300.0))
    return model, add_noise(seen, np.random.default_rng(seed))


# A gantry carries its hand where its joints say: a law that shifts the joints is
# exactly linear, and an error of the joints is an error of the position.
GANTRY = "Tx(q1) Ty(q2) Tz(q3) [hand]"
GANTRY_NOISES = {
    "sensor": Noise("declared", 1e-4, 1e-4, np.zeros(3)),
    "joints": Noise("repeats", 1e-4, 1e-4, np.array([2e-4, 0.0, 5e-5])),
    "poses": Noise("repeats", 1e-4, 1e-4, np.array([2e-4, 0.0, 5e-5]), pose_rad=1.5e-4),
}


def evaluate_waves(joint_angles, count, seed=0):
    """Columns of a made law: smooth in the joints, alike in size, ndarray (S, 3,
    count)."""
    rng = np.random.default_rng((90, seed))
    turns = rng.uniform(0.5, 3.0, (3, count, joint_angles.shape[1]))
    phases = rng.uniform(0, 2 * np.pi, (3, count))
    return np.sin(np.einsum("icj,sj->sic", turns, joint_angles) + phases)


def make_linear_law(count, priors=None, plausible=0.1, seed=0):
    """A law of so many parameters that shifts the three joints of the gantry by
    `evaluate_waves`."""
    priors = [None] * count if priors is None else priors
    listed = tuple(
        Parameter(f"p{n}", "m", plausible, prior) for n, prior in enumerate(priors)
    )

    def displacement(around):
        columns = evaluate_waves(around.joint_angles, count, seed)
        return [
            {axis: columns[:, axis, number] for axis in range(3)}
            for number in range(count)
        ]

    return Candidate("made_law", "made", (1,), "", listed, displacement)


def make_gantry_model(*laws, rows=3):
    """A model of the gantry with these laws, its foot and its target known."""
    return make_model(
        chain_of(GANTRY),
        (Target("A", "hand", (0.0, 0.0, 0.0)),),
        rows,
        fitted_frames=False,
        effects=laws,
    )


def make_gantry_states(count, poses=None, seed=0):
    """Unloaded states of the gantry, so many of them to a pose one after the other;
    repeated once to four times."""
    states = make_states(3, count, (91, seed), force=0.0)
    pose = np.arange(count) * (poses or count) // count
    return replace(
        states,
        pose=pose,
        repeats=np.random.default_rng((92, seed)).integers(1, 5, count),
    )


def observe_with_errors(states, off, turned=None):
    """Observations of the gantry that are off its commanded positions, and turned, by
    just so much: ndarrays (S, 3)."""
    rotation = None if turned is None else Rotation.from_rotvec(turned).as_matrix()
    count = len(states)
    return Observations(
        states,
        np.arange(count),
        np.zeros(count, int),
        states.joint_angles + off,
        rotation,
    )


def compute_gantry_covariance(states, noise):
    """Covariance of all positions of the gantry, written out: its Jacobian is the
    identity."""
    one = block_diag(
        *(
            (noise.position_m**2 * np.eye(3) + np.diag(noise.joint_rad**2)) / n
            for n in states.repeats
        )
    )
    pose = np.repeat(states.pose, 3)
    axis = np.tile(np.arange(3), len(states))
    return one + noise.pose_rad**2 * (pose[:, None] == pose) * (axis[:, None] == axis)
