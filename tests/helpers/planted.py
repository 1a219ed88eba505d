"""Small campaigns of a robot with known effects, and the fit of a model without these
effects."""

from dataclasses import dataclass, replace

import numpy as np
from synthetic import (
    NOISE,
    add_noise,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import Fit, fit_model
from elastocal.fitting.observations import Observations

# The offsets of these targets are known, so that only the effects are identified.
HAND = (Target("hand", "6DoF", (0.1, 0.05, 0.02)),)
ELBOW_AND_HAND = (Target("elbow", "3DoF", (0.0, 0.1, 0.05)), *HAND)


@dataclass(frozen=True)
class Planted:
    """A campaign with known effects.

    Attributes
    ----------
    declared : Fit
        Fit of the model without these effects.
    observations : Observations
        Measurements.
    candidates : dict
        Candidates of the robot by key.
    """

    declared: Fit
    observations: Observations
    candidates: dict

    @property
    def all_candidates(self):
        return list(self.candidates.values())


def two_loads_a_pose(joints, poses, seed, force=800.0):
    """Make states of some poses, each without a load and under a load of its own."""
    states = make_states(joints, 2 * poses, seed, force)
    load = np.arange(2 * poses) % 2
    pose = np.arange(2 * poses) // 2
    return replace(
        states,
        pose=pose,
        load=load,
        joint_angles=states.joint_angles[2 * pose],
        approach=states.approach[2 * pose],
        wrench=states.wrench * load[:, None],
    )


def planted(
    robot, sizes, seed=0, poses=25, targets=ELBOW_AND_HAND, states=None, **model
):
    """Make a campaign of positions, by default with identified compliances.

    Parameters
    ----------
    robot : robot that is measured
    sizes : parameters of the effects, by the keys of their candidates
    seed : seed of the states, the parameters and the noise
    poses : number of poses, if `states` is None
    targets : targets of the tracker
    states : states to measure; each pose without and with a load if None
    **model : as in `synthetic.make_model`
    """
    settings = {
        "fitted_frames": False,
        "identified": True,
        "compliance": robot.compliance,
    } | model
    declared = make_model(robot.chain, targets, **settings)
    joints = declared.sites.joints
    if states is None:
        states = two_loads_a_pose(joints, poses, (5, seed))
    candidates = candidates_on(declared.sites)
    start = make_estimate(declared, seed=seed)
    if declared.identifies_compliance:
        start = replace(start, coefficients=(robot.compliance, *start.coefficients[1:]))
    added = [candidates[key] for key in sizes]
    truth = start.with_effects(added)
    first_added = len(start.coefficients)
    for index, size in enumerate(sizes.values(), first_added):
        truth.coefficients[index][:] = size
    observations = observe_exactly(declared.with_effects(added), truth, states)
    observations = add_noise(observations, np.random.default_rng((6, seed)))
    noise = replace(NOISE, joint_rad=np.zeros(joints))
    fitted = fit_model(declared, observations, noise, start)
    return Planted(fitted, observations, candidates)
