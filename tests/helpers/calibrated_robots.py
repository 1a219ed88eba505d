"""Calibrated robots with made-up values, of any robot file and any effects of the catalogue."""

import numpy as np
from analysed_robots import ROBOTS

from elastocal.application.calibrated import CalibratedRobot, Commands, calibrated_robot
from elastocal.effects import declared_weight
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.joint_compliance import candidate as joint_compliance
from elastocal.fitting.model import Estimate, Model
from elastocal.fitting.noise import Noise
from elastocal.io.documents import read_document
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.mechanics.sites import sites_of


def made_calibrated(name: str, starts: tuple[str, ...] = (), size: float = 0.1, seed: int = 1) -> CalibratedRobot:
    """A robot of config/robots with the candidates whose keys start so, at values of about `size` of what is plausible."""
    robot = robot_from_document(read_document(ROBOTS / f"{name}.yaml"))
    sites = sites_of(robot)
    found = [c for key, c in candidates_on(sites).items() if key.startswith(starts)] if starts else []
    effects = (joint_compliance(sites), *((declared_weight.candidate(sites),) if sites.masses else ()), *found)
    draws = np.random.default_rng(seed)
    values = [size * draws.standard_normal(len(e.parameters)) * [p.plausible for p in e.parameters] for e in effects]
    values[0] = robot.compliance * draws.uniform(0.8, 1.2, robot.joints)
    shapes = tuple(np.array([shape.start for shape in effect.shapes]) for effect in effects)
    model = Model(sites, (), False, 6, robot.compliance, effects)
    nowhere = (0,), np.eye(3)[None], np.zeros((1, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3))
    spread = np.concatenate([0.05 * np.array([p.plausible for p in e.parameters] + [0.0] * len(e.shapes)) for e in effects])
    spread[: robot.joints] = 0.05 * robot.compliance
    noise = Noise("declared", 6e-5, 6e-5, np.full(robot.joints, 1e-5))
    return calibrated_robot(robot, model, Estimate(*nowhere, tuple(values), shapes), np.diag(spread**2), noise)


def drawn_commands(
    calibrated: CalibratedRobot, count: int, force: float = 200.0, seed: int = 2, reach: float = 0.8
) -> Commands:
    """Commands within the limits, each under a force and a moment."""
    robot, draws = calibrated.robot, np.random.default_rng(seed)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * (0.5 + 0.8 * (draws.random((count, robot.joints)) - 0.5))
    wrench = draws.standard_normal((count, 6)) * ([force] * 3 + [0.3 * force] * 3)
    return Commands(robot.reported_angles(angles), wrench)
