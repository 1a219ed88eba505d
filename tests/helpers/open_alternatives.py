"""Small diagnoses that leave alternatives open, and what the next experiment is planned with."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from elastocal.diagnosis import next_experiment
from elastocal.diagnosis.alarm import Alarm
from elastocal.diagnosis.alternatives import alternatives_of
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.search import posterior
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import concluded

SETTINGS = Settings(pose_steps=(0.0, 2.0), other_features=6)
RAISED = Alarm(0.002, 10.0, True)
ELASTIC = ("link_elasticity", "base_compliance", "joint_tilt")
LADDER = (0.0, 1.0, -1.0)


def diagnosed(campaign, robot, keys, declared=None):
    """A diagnosis in which only some candidates compete."""
    declared = declared or campaign.declared
    line = linearized(declared, campaign.observations, [campaign.candidates[key] for key in keys], SETTINGS)
    found = posterior(line.problem)
    conclusion = concluded(line.problem, found, RAISED)
    evidence = SimpleNamespace(linearized=line, posterior=found, alarm=RAISED, conclusion=conclusion)
    case = SimpleNamespace(observations=campaign.observations, campaign=SimpleNamespace(robot=robot))
    return SimpleNamespace(case=case, evidence=evidence, final=declared)


def limits(robot):
    return np.clip(robot.joint_limits, -2.0, 2.0)


def pieces(diagnosis):
    """Models and instrument as `propose` makes them, without the error of a pose."""
    evidence = diagnosis.evidence
    kept, reason = next_experiment._ambiguous(evidence, SETTINGS)
    assert not reason, reason
    numbers = sorted({n for models in kept.values() for model in models for n in model.units})
    lead = kept[evidence.conclusion.best.mechanisms][0]
    noise = replace(evidence.linearized.about.noise, pose_rad=lead.pose_error_rad)
    states = diagnosis.case.observations.states
    made = next_experiment.instrument_of(evidence.linearized, diagnosis.final, numbers, noise, states, LADDER)
    return alternatives_of(evidence, kept, made, lead, 1.0), made


def keys_like(campaign, *starts):
    return [key for key in campaign.candidates if key.startswith(starts)]
