"""Density of contacts: a contact is a constraint, and no height is measured.

A robot moves until its target touches, and the joint angles at which it stops are what
is measured. If the height h of the target over the feature has the density f there, the
joint angles have the density f(h) |dh/dt|, with t the way along which the robot
approaches: the Jacobian of a transformation that depends on parameters belongs to their
likelihood [1]_. Without it, a smaller robot explains contacts better, because all its
heights are smaller.

As in [1]_, heights are divided by the geometric mean of |dh/dt|, relative to that of the
nominal robot. Errors of the robot are small, so that this mean grows linearly with them.
The mean strain by a parameter is its growth by a unit: how much farther, on average, the
target moves along the normal of its feature if the joints move as before. The robot
approaches along the normal and does not turn the target.

References
----------
.. [1] Box and Cox, An analysis of transformations, Journal of the Royal Statistical
   Society B 26, 1964.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    evaluate_conditions,
    find_placement_parameters,
    list_parameters,
    predict,
    predict_channels,
)
from elastocal.fitting.observations import sample_observations

if TYPE_CHECKING:
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Way along which strains are differenced, m: short for a robot, and far above rounding.
_STEP_M = 1e-4
# Singular values of a Jacobian below this share of the largest belong to directions in
# which a robot near a singularity does not approach.
_SINGULAR = 1e-2
# Largest deviation of a motion from a shift along the normal, in units of the shift.
_CLOSE = 1e-6
# Joints with which an arm reaches a pose.
_JOINTS_OF_A_POSE = 6
# A mean over more contacts than this tells no more.
_MOST_CONTACTS = 2_000


def compute_mean_strains(
    model: Model, estimate: Estimate, observations: Observations
) -> np.ndarray | None:
    """Compute the mean strain (P,) by a unit of each parameter.

    Frames, targets and features strain nothing. None unless all observations are
    contacts with a single number, such as those with planes and spheres.
    """
    plan = model.measuring
    if plan is None or not plan.is_touch_alone(observations.position):
        return None
    contacts = sample_observations(observations, _MOST_CONTACTS)
    motion, is_possible = _find_approach(model, estimate, contacts)
    if not is_possible.any():
        return None
    ahead, behind = (
        _compute_sensitivities(model, estimate, contacts, sign * _STEP_M * motion)
        for sign in (1.0, -1.0)
    )
    change = (ahead - behind)[is_possible] / (2.0 * _STEP_M)
    strains: np.ndarray = change.mean(axis=0)
    owners = [owner for owner, _ in list_parameters(model, estimate)]
    strains[find_placement_parameters(owners)] = 0.0
    return strains


def _find_approach(
    model: Model, estimate: Estimate, contacts: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """Find the motion of the joints that shifts the target along the normal of its
    feature and does not turn it.

    Several targets that touch in one state share the mean of their motions.

    Returns
    -------
    motion : (S, n) array, rad/m
    is_possible : (M,) bool array
        Contacts that the robot can approach so: it is not near a singularity, has enough
        joints, and has no other target that touches.
    """
    conditions = evaluate_conditions(model, estimate, contacts.states)
    poses = predict(model, estimate, contacts, conditions)
    count = len(contacts)
    shift = np.zeros((count, 6, 1))
    by_pose = predict_channels(model, estimate, contacts, *poses).by_pose
    shift[:, :3, 0] = by_pose[:, 0, :3]
    # The same contacts, as if a tracker measured the poses of their targets.
    tracked = replace(
        contacts,
        position=np.zeros((count, 3)),
        rotation=np.tile(np.eye(3), (count, 1, 1)),
        channel=None,
    )
    jacobian = linearize(
        replace(model, measuring=None, shaped_noise=None, rows=6),
        replace(estimate, features=()),
        tracked,
        conditions,
    ).joint_jacobian
    if model.sites.joints < _JOINTS_OF_A_POSE:
        # Such an arm cannot shift the target without turning it.
        jacobian = jacobian[:, :3]
        shift = shift[:, :3]
    motion = (np.linalg.pinv(jacobian, _SINGULAR) @ shift)[..., 0]
    total = np.zeros(contacts.states.joint_angles.shape)
    np.add.at(total, contacts.state, motion)
    targets = np.bincount(contacts.state, minlength=len(total))
    shared = total / targets[:, None]
    achieved = (jacobian @ shared[contacts.state][..., None]) - shift
    return shared, np.linalg.norm(achieved[..., 0], axis=1) < _CLOSE


def _compute_sensitivities(
    model: Model, estimate: Estimate, contacts: Observations, motion: np.ndarray
) -> np.ndarray:
    """Compute the sensitivities (M, P) of heights after a motion (S, n) of the joints."""
    states = contacts.states
    moved = replace(states, joint_angles=states.joint_angles + motion)
    conditions = evaluate_conditions(model, estimate, moved)
    linear_model = linearize(
        model, estimate, replace(contacts, states=moved), conditions
    )
    return linear_model.sensitivities[:, 0]
