"""Synthetic calibrated robots: effects of plausible size, and the covariance that a fit
would estimate."""

from dataclasses import replace

import numpy as np
from synthetic import NOISE

from elastocal.application.calibrated import calibrate_by_model
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.fitting.model import Estimate, Model, list_parameters
from elastocal.mechanics.sites import build_sites

# Effects of a good arm, of each family that an afternoon of measurements identifies.
USUAL = (
    *(f"joint_offset@{joint}" for joint in range(2, 6)),
    *(f"link_geometry@{joint}" for joint in range(1, 6)),
    "link_weight@2",
    "link_weight@3",
)


def plain_model(robot, *keys, identified=True):
    """Make the model of a robot in its base frame without targets, with joint
    compliances, declared masses and the candidates of these keys."""
    sites = build_sites(robot)
    candidates = candidates_on(sites)
    effects = [candidates[key] for key in keys]
    if sites.masses:
        effects.insert(0, declared_weight(sites))
    if identified:
        effects.insert(0, joint_compliance(sites))
    return Model(
        sites,
        targets=(),
        fitted_frames=False,
        rows=6,
        nominal_compliance=robot.compliance,
        effects=tuple(effects),
    )


def shape_starts(effect):
    """Return the starts of the shape parameters of an effect."""
    return np.array([shape.start for shape in effect.shapes])


def plain_estimate(model, coefficients, shapes=None):
    """Make an estimate with these coefficients of the effects; shape parameters are at
    their starts by default."""
    if not shapes:
        starts = [shape_starts(effect) for effect in model.effects]
        shapes = tuple(starts)
    no_targets = np.zeros((0, 3))
    return Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        no_targets,
        np.zeros((0, 3, 3)),
        tuple(coefficients),
        shapes,
    )


def make_calibrated_robot(
    robot, *keys, seed=0, size=0.3, relative_std=0.02, identified=True, noise=None
):
    """Make a calibrated robot with every parameter at up to `size` times its plausible
    size, and a standard error of `relative_std` times that size."""
    rng = np.random.default_rng(seed)
    model = plain_model(robot, *keys, identified=identified)
    coefficients = []
    for effect in model.effects:
        plausible = np.array([parameter.plausible for parameter in effect.parameters])
        drawn = size * plausible * rng.uniform(-1, 1, len(plausible))
        if effect.effect == "joint_compliance":
            drawn = robot.compliance * (1 + 0.1 * drawn / plausible)
        coefficients.append(drawn)
    estimate = plain_estimate(model, coefficients)
    sizes = np.array(
        [parameter.plausible for _, parameter in list_parameters(model, estimate)]
    )
    mixed = (
        np.eye(len(sizes))
        + 0.3
        * rng.standard_normal((len(sizes), len(sizes)))
        / max(len(sizes), 1) ** 0.5
    )
    root = relative_std * sizes[:, None] * mixed
    noise = noise or replace(NOISE, joint_rad=np.zeros(robot.joints))
    return calibrate_by_model(robot, model, estimate, root @ root.T, noise)
