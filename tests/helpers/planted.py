"""Small campaigns of a known robot that lacks what is planted in it, fitted without
that."""

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

# At known places, so that nothing but the effects is to be identified.
HAND = (Target("hand", "6DoF", (0.1, 0.05, 0.02)),)
ELBOW_AND_HAND = (Target("elbow", "3DoF", (0.0, 0.1, 0.05)), *HAND)


@dataclass(frozen=True)
class Planted:
    """A campaign whose ground truth is known.

    `declared`: of the model that lacks what was planted.
    """

    declared: Fit
    observations: Observations
    candidates: dict

    @property
    def all_candidates(self):
        return list(self.candidates.values())


def two_loads_a_pose(joints, poses, seed, force=800.0):
    """States of `poses` poses, each unloaded and under a load of its own."""
    states = make_states(joints, 2 * poses, seed, force)
    wrench = states.wrench * (np.arange(2 * poses) % 2)[:, None]
    pose = np.arange(2 * poses) // 2
    return replace(
        states,
        pose=pose,
        load=np.arange(2 * poses) % 2,
        joint_angles=states.joint_angles[2 * pose],
        approach=states.approach[2 * pose],
        wrench=wrench,
    )


def planted(
    robot, sizes, seed=0, poses=25, targets=ELBOW_AND_HAND, states=None, **model
):
    """A campaign of positions and, by default, identified compliances.

    `sizes`: what is planted: parameters by the key of a candidate. `**model`: as in
    `synthetic.made_model`.
    """
    settings = {
        "fitted_frames": False,
        "identified": True,
        "compliance": robot.compliance,
    } | model
    declared = make_model(robot.chain, targets, **settings)
    states = (
        two_loads_a_pose(declared.sites.joints, poses, (5, seed))
        if states is None
        else states
    )
    candidates = candidates_on(declared.sites)
    start = make_estimate(declared, seed=seed)
    if declared.identifies_compliance:
        start = replace(start, coefficients=(robot.compliance, *start.coefficients[1:]))
    added = [candidates[key] for key in sizes]
    true = start.with_effects(added)
    for number, size in enumerate(sizes.values()):
        true.coefficients[len(start.coefficients) + number][:] = size
    seen = observe_exactly(declared.with_effects(added), true, states)
    seen = add_noise(seen, np.random.default_rng((6, seed)))
    noise = replace(NOISE, joint_rad=np.zeros(declared.sites.joints))
    return Planted(fit_model(declared, seen, noise, start), seen, candidates)
