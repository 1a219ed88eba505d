"""Models of a robot with effects by their keys, measurements of them, and what a fit could not tell."""

from dataclasses import replace

import numpy as np
from synthetic import candidate_on, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target

TARGETS = Target("A", "6DoF", None), Target("B", "3DoF", None)


def model_of(robot, *keys, targets=TARGETS[:1], **options):
    """A model of a robot with its nominal springs and these candidates of the catalogue; one target unless told."""
    effects = tuple(candidate_on(robot.chain, key) for key in keys)
    return made_model(robot.chain, targets, effects=effects, compliance=robot.compliance, **options)


def names_held(found):
    """Owners and names of the parameters that a fit held."""
    return [f"{owner} {p.name}" for (owner, p), held in zip(found.parameters, found.held, strict=True) if held]


def bent(fanuc, seed, shape, key="thermal_growth[time]"):
    """Noisy measurements of a law with a shape somewhere in its range, and the model that made them."""
    model = model_of(fanuc, key)
    true = made_estimate(model, seed=seed)
    true = replace(true, shapes=(np.array([shape]),))
    seen = seen_exactly(model, true, made_states(6, 30, seed=seed, force=300.0))
    return model, with_noise(seen, np.random.default_rng(seed))
