"""Calibrated robots made up for tests: effects of plausible size, and what a fit would
say of them."""

from dataclasses import replace

import numpy as np
from synthetic import NOISE

from elastocal.application.calibrated import calibrate_by_model
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.fitting.model import Estimate, Model, list_parameters
from elastocal.mechanics.sites import build_sites

# What a good arm has, of each family that an afternoon finds.
USUAL = (
    *(f"joint_offset@{joint}" for joint in range(2, 6)),
    *(f"link_geometry@{joint}" for joint in range(1, 6)),
    "link_weight@2",
    "link_weight@3",
)


def plain_model(robot, *keys, identified=True):
    """The model of a robot at its foot, with springs and these candidates; no targets
    yet."""
    sites = build_sites(robot)
    found = candidates_on(sites)
    springs = (joint_compliance(sites),) if identified else ()
    weight = (declared_weight(sites),) if sites.masses else ()
    return Model(
        sites,
        (),
        False,
        6,
        robot.compliance,
        (*springs, *weight, *(found[key] for key in keys)),
    )


def plain_estimate(model, coefficients, shapes=None):
    """Values of the effects of such a model."""
    shapes = shapes or tuple(
        np.array([shape.start for shape in effect.shapes]) for effect in model.effects
    )
    none = np.zeros((0, 3))
    return Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        none,
        np.zeros((0, 3, 3)),
        tuple(coefficients),
        shapes,
    )


def make_calibrated_robot(
    robot, *keys, seed=0, size=0.3, relative_std=0.02, identified=True, noise=None
):
    """A calibrated robot with every parameter at up to `size` of its plausible size,
    known to a share of that."""
    rng = np.random.default_rng(seed)
    model = plain_model(robot, *keys, identified=identified)
    coefficients = []
    for effect in model.effects:
        plausible = np.array([parameter.plausible for parameter in effect.parameters])
        drawn = size * plausible * rng.uniform(-1, 1, len(plausible))
        coefficients.append(
            robot.compliance * (1 + 0.1 * drawn / plausible)
            if effect.effect == "joint_compliance"
            else drawn
        )
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
