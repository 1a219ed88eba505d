"""Calibrated robots with every kind of effect that a command contains, as if a campaign
had identified them."""

from dataclasses import replace
from functools import cache

import numpy as np
from analysed_robots import analysed
from made_loop_tables import CAMPAIGNS
from synthetic import make_estimate, make_states, observe_exactly

from elastocal.application.calibrated import CampaignFit, ResidualModel
from elastocal.application.model_file import describe_model, write_model
from elastocal.application.scope import calibrate_by_campaign_fit
from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.geometry import declared_base
from elastocal.effects.gravity import declared_application_point, declared_weight
from elastocal.fitting.model import Model, list_parameters
from elastocal.fitting.noise import Noise
from elastocal.mechanics.robot import Compensator
from elastocal.mechanics.sites import build_sites
from elastocal.residual_model.selection import fit_to_observations, is_commanded
from elastocal.verdict import CrossValidatedGain, RegressionChoice, Spread

# A robot of seven joints of which one follows another: six angles command it.
FOLLOWING = "iiwa14, of which one joint follows another"
ROBOTS = ("kuka", "fanuc", "ur10", "iiwa14", "gen3", FOLLOWING)
# The robot whose base is declared; the others have fitted frames.
DECLARED_BASE = "gen3"
# A regression of each kind on the residuals, and its setting.
SETTINGS = {
    "ridge_harmonics": {"orders": 2, "penalty": 1e-3},
    "two_joints": {},
    "gaussian_process": {},
    "extra_trees": {"min_samples_split": 5, "max_features": 1.0},
}
STATES = 60


def equip(name):
    """Read a robot; give it a compensator and a gear ratio, so that every effect has
    candidates, and joint angles that its controller reports otherwise."""
    robot = analysed(name.partition(",")[0])
    matrix = np.eye(robot.joints)
    matrix[2, 1] = 1.0
    if name == FOLLOWING:
        matrix[2, 1] = -0.5
        matrix = np.delete(matrix, 2, axis=1)
    return replace(
        robot,
        joint_limits=np.tile([-9.0, 9.0], (robot.joints, 1)),
        compensator=Compensator(2, "spring"),
        gear_ratio=(101.0, *[None] * (robot.joints - 1)),
        reported_matrix=matrix,
        reported_offset=np.linspace(0.0, 0.3, robot.joints),
    )


def choose_effects(sites):
    """Choose two candidates of each effect that a command contains, and one of an
    effect that it does not."""
    chosen = {}
    for candidate in candidates_on(sites).values():
        if is_commanded(candidate):
            chosen.setdefault(candidate.effect, []).append(candidate)
    point_error = declared_application_point(sites, 2e-3)
    effects = [joint_compliance(sites), point_error, declared_base(sites)]
    if sites.masses:
        effects.append(declared_weight(sites))
    for candidates in chosen.values():
        effects += {id(c): c for c in (candidates[0], candidates[-1])}.values()
    return (*effects, candidates_on(sites)["hysteresis@2"])


def make_choice(regression):
    """State the choice of a regression."""
    gain = CrossValidatedGain(0.9, 5.0, 0.01, 1e-4, 1e-5, 0.05)
    spread = Spread(1.1, 5e-5, 1.0)
    setting = SETTINGS[regression]
    return RegressionChoice(regression, regression, 1, setting, spread, gain)


def make_reachable_states(robot, count, seed, **draws):
    """Make states whose joint angles a command can bring about together."""
    states = make_states(robot.joints, count, seed, **draws)
    commands = robot.reported_angles(states.joint_angles)
    return replace(states, joint_angles=robot.model_angles(commands))


@cache
def make_calibrated(name, regression="", seed=3):
    """Make a calibrated robot with a regression on its residuals, if one is named."""
    robot = equip(name)
    sites = build_sites(robot)
    model = Model(
        sites,
        (Target("A", sites.chain.end_effector.name, None),),
        fitted_frames=name != DECLARED_BASE,
        rows=3,
        nominal_compliance=robot.compliance,
        effects=choose_effects(sites),
        base_std_m=2e-4 * (name == DECLARED_BASE),
    )
    estimate = make_estimate(model, seed=seed, size=0.2)
    states = make_reachable_states(robot, STATES, seed, force=100.0, span=1.5)
    observations = observe_exactly(model, estimate, states)
    wrong = 2e-4 * np.sin(states.joint_angles[:, :3] + states.joint_angles[:, 1:4])
    observations = replace(observations, position=observations.position + wrong)
    sizes = [parameter.plausible for _, parameter in list_parameters(model, estimate)]
    fit = CampaignFit(model, estimate, np.diag(np.square(sizes) * 1e-4), observations)
    residual_model = None
    if regression:
        choice = make_choice(regression)
        predictor = fit_to_observations(choice, model, estimate, observations)
        residual_model = ResidualModel(
            predictor, estimate.target_offset[0], 2e-5, 1.0, choice
        )
    noise = Noise("declared", 6e-5, 6e-5, np.full(robot.joints, 1e-5))
    return calibrate_by_campaign_fit(robot, fit, noise, residual_model, 0.0)


def draw_commands(calibrated, count=1000, seed=5):
    """Draw commands within and somewhat beyond the fitted range, and their loads."""
    states = make_reachable_states(calibrated.robot, count, seed, force=80.0, span=1.6)
    return calibrated.robot.reported_angles(states.joint_angles), states.wrench


def write_made_model(path, calibrated):
    """Write the model file of such a robot."""
    write_model(path, describe_model(calibrated, CAMPAIGNS["named"]))
    return path


def calibrate_exactly(robot, *keys, seed=3):
    """Make a calibrated robot with effects of these keys and its compliances, from a
    campaign in its base frame."""
    sites = build_sites(robot)
    catalogue = candidates_on(sites)
    effects = [joint_compliance(sites)]
    if sites.masses:
        effects.append(declared_weight(sites))
    effects += [catalogue[key] for key in keys]
    model = Model(
        sites,
        (Target("A", sites.chain.end_effector.name, (0.0, 0.0, 0.0)),),
        fitted_frames=False,
        rows=3,
        nominal_compliance=robot.compliance,
        effects=tuple(effects),
    )
    estimate = make_estimate(model, seed=seed, size=0.3)
    coefficients = (robot.compliance, *estimate.coefficients[1:])
    estimate = replace(estimate, coefficients=coefficients)
    states = make_states(robot.joints, STATES, seed, force=100.0, span=1.5)
    observations = observe_exactly(model, estimate, states)
    covariance = 1e-12 * np.eye(len(list_parameters(model, estimate)))
    fit = CampaignFit(model, estimate, covariance, observations)
    noise = Noise("declared", 6e-5, 6e-5, np.full(robot.joints, 1e-5))
    return calibrate_by_campaign_fit(robot, fit, noise, None, 0.0)
