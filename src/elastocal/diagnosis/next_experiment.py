"""The next experiment: poses and loads after which the measurements most probably
decide which hypothesis holds.

Each pose is measured at the campaign's targets without its load and under it. The loads
are those of the campaign, scaled up to its largest one or to the rated payload.

A hypothesis, in its most probable model, is linear in its coefficients. If the present
measurements leave these normal with mean m and covariance C, new rows A are expected
with mean A m and covariance I + A C A'. The separation of the best hypothesis from
another one is eight times the Bhattacharyya distance of both predictions (Kailath, IEEE
Transactions on Communication Technology 1967). If both predict with the same covariance
it is their squared Mahalanobis distance, or twice the expected log Bayes factor.

Poses are chosen one after the other from random ones, each so that it minimises the
bound on the probability of a wrong decision, the sum of sqrt(p q) exp(-separation / 8).
What the earlier poses will show is accounted for by conditioning on them, as a Kalman
filter does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g as standard_gravity
from scipy.special import ndtr

from elastocal.campaigns.measurements import name_joint_columns
from elastocal.diagnosis.candidate_design import WhitenedFit
from elastocal.diagnosis.refit import predict_reduced_chi_square
from elastocal.diagnosis.statistics import assemble_normal_equations
from elastocal.diagnosis.verdict import (
    ADEQUATE,
    NAMED,
    NOT_TESTABLE,
    Evidence,
    Hypothesis,
    replace_mechanism,
)
from elastocal.fitting.model import evaluate_conditions
from elastocal.fitting.observations import Observations, States
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.verdict import NextExperiment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.search import ScoredModel
    from elastocal.fitting.model import Model as FittedModel
    from elastocal.mechanics.robot import Robot

    Table = dict[str, np.ndarray]

# Reasons why there is nothing to measure.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING = "nothing is missing"
NOTHING_AMBIGUOUS = "no other set of mechanisms is probable"
DATA_AT_FAULT = "the data are at fault"
NOTHING_TESTABLE = "the measurements can test no mechanism"
# Number of random experiments to choose from.
_CANDIDATE_EXPERIMENTS = 200
# Number of hypotheses between which to decide; others hold a few per cent.
_HYPOTHESES = 6
# No experiment has more poses than this: they take some two days with a tracker.
_MOST_POSES = 100
# An ambiguity counts as resolved if the right hypothesis gets these odds against the
# other one.
_SURE_ODDS = 19.0


def draw_candidate_experiments(
    states: States, robot: Robot, count: int, stream: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw random joint angles within the limits, with the heavier loads of a campaign.

    Parameters
    ----------
    states : states of the campaign
    robot : the robot
    count : number E of experiments
    stream : random numbers

    Returns
    -------
    joint_angles : (E, n), rad
    wrench : (E, 6), at the last measuring point, N and N m
    """
    limits = np.clip(robot.joint_limits, -np.pi, np.pi)
    angles = robot.spread_angles(stream.random((count, robot.commands)), limits)
    force = np.linalg.norm(states.wrench[:, :3], axis=1)
    if not force.any():
        return angles, np.zeros((count, 6))
    heavy = np.flatnonzero(force >= np.median(force[force > 0]))
    chosen = heavy[stream.integers(0, len(heavy), count)]
    largest = max(force.max(), (robot.payload_kg or 0.0) * standard_gravity)
    return angles, states.wrench[chosen] * (largest / force[chosen])[:, None]


def draw_measured_experiments(
    observations: Observations, count: int, stream: np.random.Generator
) -> Observations:
    """Draw experiments that measure an observation of the campaign again.

    At other joint angles the robot would not touch the features of the campaign.

    Returns
    -------
    Observations, each of a pose of its own
    """
    chosen = stream.integers(0, len(observations), count)
    states = observations.states.select(observations.state[chosen])
    states = replace(states, pose=np.arange(count), repeats=np.ones(count, int))
    return replace(
        observations,
        states=states,
        state=np.arange(count),
        target=observations.target[chosen],
        position=observations.position[chosen],
        rotation=_select(observations.rotation, chosen),
        channel=_select(observations.channel, chosen),
        spread=_select(observations.spread, chosen),
    )


def _select(values: np.ndarray | None, chosen: np.ndarray) -> np.ndarray | None:
    return None if values is None else values[chosen]


def build_planned_observations(
    model: FittedModel, states: States, angles: np.ndarray, wrench: np.ndarray
) -> Observations:
    """Build observations of planned experiments, with zeros for what is measured.

    The joints are approached from either side in turn. Clock and temperature stay as in
    the last state of the campaign.

    Parameters
    ----------
    model : the fitted model, whose targets are measured
    states : states of the campaign
    angles : (E, n), joint angles, rad
    wrench : (E, 6), load of each experiment

    Returns
    -------
    Observations of one experiment are consecutive: without its load, and under it.
    """
    has_loads = states.wrench[:, :3].any()
    shares = np.array([0.0, 1.0] if has_loads else [1.0])
    experiment = np.repeat(np.arange(len(angles)), len(shares))
    load = np.tile(np.arange(len(shares)), len(angles))
    count = len(experiment)
    columns = {
        name: np.repeat(values[-1:], count, axis=0)
        for name, values in vars(states).items()
        if values is not None
    }
    columns |= {
        "pose": experiment,
        "load": load,
        "joint_angles": angles[experiment],
        "wrench": wrench[experiment] * shares[load, None],
        "repeats": np.ones(count, int),
    }
    if states.approach is not None:
        parity = np.add.outer(np.arange(count), np.arange(angles.shape[1])) % 2
        columns["approach"] = np.where(parity, -1.0, 1.0)
    targets = len(model.targets)
    state = np.repeat(np.arange(count), targets)
    target = np.tile(np.arange(targets), count)
    rotation = np.tile(np.eye(3), (len(target), 1, 1)) if model.rows == 6 else None
    return Observations(
        States(**columns), state, target, np.zeros((len(target), 3)), rotation
    )


def compute_whitened_rows(
    design: CandidateDesign,
    observations: Observations,
    columns: np.ndarray,
    pose_error_rad: float,
) -> np.ndarray:
    """Compute whitened sensitivities of planned experiments.

    Parameters
    ----------
    design : design of the campaign
    observations : observations of E experiments with R numbers each
    columns : (D,) int, candidate columns
    pose_error_rad : error that the measurements of an experiment have in common

    Returns
    -------
    (E, R, P + D), sensitivities to the orthonormal declared columns of the design's
    products, and to the candidate columns orthogonal to them
    """
    fitted = design.reference_fit
    products = design.products
    conditions = evaluate_conditions(fitted.model, fitted.estimate, observations.states)
    # The experiments follow the last row of the campaign.
    conditions = replace(conditions, progress=np.ones(len(observations.states)))
    planned = WhitenedFit(
        replace(fitted, weights=np.ones(len(observations))),
        observations,
        conditions,
        design.whitened.candidate_keys,
    )
    rows = replace(design, whitened=planned).rows
    basis = rows.declared @ products.basis_transform
    candidates = (
        rows.candidates.dense()[..., columns] - basis @ products.projections[:, columns]
    )
    experiments = rows.pose.max() + 1
    width = basis.shape[-1] + len(columns)
    sensitivities = np.concatenate([basis, candidates], axis=-1).reshape(
        experiments, -1, width
    )
    numbers = sensitivities.shape[1]
    jacobian = rows.jacobian.reshape(experiments, numbers, -1)
    common = pose_error_rad**2 * jacobian @ jacobian.swapaxes(1, 2)
    factor = np.linalg.cholesky(np.eye(numbers) + common)
    return np.linalg.solve(factor, sensitivities)


def compute_coefficient_posteriors(
    design: CandidateDesign,
    columns: np.ndarray,
    models: Sequence[ScoredModel],
    noise_factor: float,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Compute the posterior of the declared parameters and some columns (D,) under each
    model, zero for columns that the model does not have.

    Half-normal priors count as normal ones.

    Parameters
    ----------
    design : design of the campaign
    columns : (D,) int, rising
    models : models; the pose error is that of the first one
    noise_factor : the true noise over the noise that whitened the rows, in whose units
        the coefficients are

    Returns
    -------
    Mean (P + D,) and covariance (P + D, P + D) for each model
    """
    count = design.products.declared_count
    declared = np.arange(count)
    equations = (
        assemble_normal_equations(design.products, models[0].pose_error_rad, columns)
        / noise_factor**2
    )
    posteriors = []
    for model in models:
        of_model, deviations = design.problem.scaled_columns(
            model.term_indices, model.scales
        )
        indices = np.append(declared, count + np.searchsorted(columns, of_model))
        prior = np.append(0.0 * declared, (noise_factor * deviations) ** -2)
        precision = equations[np.ix_(indices, indices)] + np.diag(prior)
        covariance = np.zeros((len(equations) - 1, len(equations) - 1))
        covariance[np.ix_(indices, indices)] = np.linalg.inv(precision)
        posteriors.append((covariance @ equations[:-1, -1], covariance))
    return posteriors


@dataclass(frozen=True)
class HypothesisPair:
    """Two hypotheses after some experiments.

    Attributes
    ----------
    mean_difference : (U,), difference of the means of their coefficients
    covariances : (3, U, U), the average of both covariances, and each
    separation : by the experiments so far
    """

    mean_difference: np.ndarray
    covariances: np.ndarray
    separation: float = 0.0

    @classmethod
    def of(
        cls, first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]
    ) -> HypothesisPair:
        """Pair two normal distributions, each with mean and covariance."""
        average = (first[1] + second[1]) / 2
        return cls(first[0] - second[0], np.array([average, first[1], second[1]]))

    def separation_gains(self, rows: np.ndarray) -> np.ndarray:
        """Separation (E,) that each of some further experiments (E, R, U) would add."""
        covariances = self.covariances[:, None]
        predicted = np.eye(rows.shape[1]) + rows @ covariances @ rows.swapaxes(1, 2)
        difference = (rows @ self.mean_difference)[..., None]
        solved = np.linalg.solve(predicted[0], difference)
        squares = (difference * solved).sum(axis=(1, 2))
        log_dets = np.linalg.slogdet(predicted)[1]
        return squares + np.array([4.0, -2.0, -2.0]) @ log_dets

    def condition_on(self, rows: np.ndarray) -> HypothesisPair:
        """The pair after one experiment (R, U), on average over what it may measure."""
        projected = rows @ self.covariances
        innovation = np.eye(len(rows)) + projected @ rows.T
        gain = np.linalg.solve(innovation, projected).swapaxes(1, 2)
        difference = self.mean_difference - gain[0] @ (rows @ self.mean_difference)
        added = float(self.separation_gains(rows[None])[0])
        return HypothesisPair(
            difference, self.covariances - gain @ projected, self.separation + added
        )


def select_experiments(
    pairs: Sequence[HypothesisPair], weights: np.ndarray, rows: np.ndarray, count: int
) -> tuple[list[int], np.ndarray]:
    """Select experiments, each the best one given those before it.

    Parameters
    ----------
    pairs : pairs of hypotheses to separate
    weights : (pairs,), weight of each pair in the bound
    rows : (E, R, U), experiments to choose from
    count : number of experiments to select

    Returns
    -------
    chosen : indices of the experiments
    separations : (count, pairs), of each pair after each experiment
    """
    chosen: list[int] = []
    separations = []
    present = list(pairs)
    for _ in range(count):
        exponents = [
            -(pair.separation + pair.separation_gains(rows)) / 8.0 for pair in present
        ]
        bound = weights @ np.exp(exponents)
        bound[chosen] = np.inf
        best = int(np.argmin(bound))
        chosen.append(best)
        present = [pair.condition_on(rows[best]) for pair in present]
        separations.append([pair.separation for pair in present])
    return chosen, np.array(separations)


def compute_resolution_probability(separation: np.ndarray | float) -> np.ndarray:
    """Compute the probability that the right one of two hypotheses gets odds of 19:1
    from even ones.

    The log Bayes factor is normal with the separation as its variance, and half of it
    as its mean, if both hypotheses predict with the same covariance.
    """
    variance = np.maximum(separation, 1e-12)
    excess = 0.5 * variance - np.log(_SURE_ODDS)
    return np.asarray(ndtr(excess / np.sqrt(variance)))


def propose_experiment(
    diagnosis: Diagnosis, stream: np.random.Generator, poses: int = 10
) -> tuple[Table, NextExperiment]:
    """Propose the poses and loads that most probably resolve what a diagnosis leaves
    ambiguous.

    Parameters
    ----------
    diagnosis : the diagnosis
    stream : random numbers
    poses : number of poses

    Returns
    -------
    table : columns of the proposed poses, the most valuable first: ``effect``, the best
        hypothesis and the nearest alternative; ``pose``; ``point``, where the targets
        are measured; joint angles as the controller reports them, rad; the load;
        ``separation`` from the nearest alternative by this pose and all before it; and
        the probability ``resolved`` that follows from it
    summary : what verdict.json says. The promise leaves aside hypotheses that no
        experiment within reach distinguishes from the best one.
    """
    robot = diagnosis.case.campaign.robot
    evidence = diagnosis.evidence
    if evidence is None:
        return _explain_no_experiment(robot, (), DATA_AT_FAULT)
    best = evidence.conclusion.best.mechanisms
    reason = _find_reason_against(evidence)
    if reason:
        return _explain_no_experiment(robot, best, reason)
    hypotheses = _select_hypotheses(evidence)
    model = diagnosis.final.model
    observations = diagnosis.case.observations
    if model.measuring is None:
        angles, wrench = draw_candidate_experiments(
            observations.states, robot, _CANDIDATE_EXPERIMENTS, stream
        )
        planned = build_planned_observations(model, observations.states, angles, wrench)
    else:
        planned = draw_measured_experiments(
            observations, _CANDIDATE_EXPERIMENTS, stream
        )
        angles = planned.states.joint_angles
        wrench = planned.states.wrench
    pairs, rows = _predict_experiments(evidence, hypotheses, planned)
    plan = _Plan.choose(hypotheses, pairs, rows, poses)
    if plan.unreachable and plan.certainty >= evidence.design.settings.credible:
        return _explain_no_experiment(
            robot, best, NOT_DISTINGUISHABLE, plan.unreachable
        )
    table = _build_table(
        robot, angles[plan.chosen], wrench[plan.chosen], plan.least_separations
    )
    points = dict.fromkeys(target.point for target in model.targets)
    table["effect"] = np.full(
        poses, f"{' + '.join(best)} or {' + '.join(plan.nearest)}"
    )
    table["point"] = np.full(poses, " ".join(points))
    return table, NextExperiment(
        poses,
        reason="",
        best=best,
        nearest=plan.nearest,
        indistinguishable=plan.unreachable,
        separation=float(table["separation"][-1]),
        resolved=float(table["resolved"][-1]),
    )


@dataclass(frozen=True)
class _Plan:
    """Chosen experiments, and what they promise.

    Attributes
    ----------
    chosen : indices of the experiments
    least_separations : (experiments,), smallest separation of the alternatives that
        some experiment within reach can resolve
    nearest : mechanisms of the alternative within reach that is separated least
    unreachable : mechanisms of the alternatives that no experiment within reach
        resolves
    certainty : probability of the best hypothesis against the alternatives within
        reach. If it is as large as an unambiguous diagnosis asks for, nothing that can
        be resolved is ambiguous.
    """

    chosen: list[int]
    least_separations: np.ndarray
    nearest: tuple[str, ...]
    unreachable: tuple[tuple[str, ...], ...]
    certainty: float

    @classmethod
    def choose(
        cls,
        hypotheses: list[Hypothesis],
        pairs: Sequence[HypothesisPair],
        rows: np.ndarray,
        poses: int,
    ) -> _Plan:
        """Choose experiments from some rows (E, R, U) that separate the first
        hypothesis from the others."""
        probabilities = np.array([h.probability for h in hypotheses])
        weights = np.sqrt(probabilities[0] * probabilities[1:])
        chosen, separations = select_experiments(pairs, weights, rows, poses)
        # Repeat the experiments up to the largest number of poses. A pair is within
        # reach if they then resolve it more likely than not.
        repeated = np.sqrt(_MOST_POSES / poses) * rows[chosen].reshape(
            1, -1, rows.shape[-1]
        )
        gains = np.array([pair.separation_gains(repeated)[0] for pair in pairs])
        within_reach = compute_resolution_probability(gains) >= 0.5
        separations = np.where(within_reach, separations, np.inf)
        alternatives = [h.mechanisms for h in hypotheses[1:]]
        weight_of_alternatives = probabilities[1:][within_reach].sum()
        return cls(
            chosen,
            separations.min(axis=1),
            alternatives[int(np.argmin(separations[-1]))],
            tuple(alternatives[n] for n in np.flatnonzero(~within_reach)),
            float(probabilities[0] / (probabilities[0] + weight_of_alternatives)),
        )


def _predict_experiments(
    evidence: Evidence, hypotheses: Sequence[Hypothesis], planned: Observations
) -> tuple[list[HypothesisPair], np.ndarray]:
    """Pairs of the best hypothesis with each alternative, and the rows (E, R, U) of
    planned experiments in units of the noise that the best one leaves."""
    design = evidence.design
    models = [evidence.posterior.models[h.model] for h in hypotheses]
    misfit = predict_reduced_chi_square(design.problem, models[0])
    noise_factor = float(np.sqrt(max(misfit, 1.0)))
    of_models = [
        design.problem.scaled_columns(model.term_indices, model.scales)[0]
        for model in models
    ]
    columns = np.unique(np.concatenate(of_models))
    rows = compute_whitened_rows(design, planned, columns, models[0].pose_error_rad)
    leading, *following = compute_coefficient_posteriors(
        design, columns, models, noise_factor
    )
    pairs = [HypothesisPair.of(leading, posterior) for posterior in following]
    return pairs, rows / noise_factor


def _build_table(
    robot: Robot, angles: np.ndarray, wrench: np.ndarray, separation: np.ndarray
) -> Table:
    """Columns of proposed poses; effect and point are empty."""
    count = len(angles)
    return {
        "effect": np.full(count, ""),
        "pose": np.arange(count),
        "point": np.full(count, ""),
        **name_joint_columns(robot.reported_angles(angles)),
        **dict(zip(WRENCH_NAMES, wrench.T, strict=True)),
        "separation": separation,
        "resolved": compute_resolution_probability(separation),
    }


def _explain_no_experiment(
    robot: Robot,
    best: tuple[str, ...],
    reason: str,
    indistinguishable: tuple[tuple[str, ...], ...] = (),
) -> tuple[Table, NextExperiment]:
    """An empty table, and the reason why there is nothing to measure."""
    table = _build_table(
        robot, np.zeros((0, robot.joints)), np.zeros((0, 6)), np.zeros(0)
    )
    return table, NextExperiment(
        0,
        reason,
        best,
        nearest=(),
        indistinguishable=indistinguishable,
        separation=None,
        resolved=None,
    )


def _find_reason_against(evidence: Evidence) -> str:
    """Why there is nothing to resolve; empty if there is."""
    conclusion = evidence.conclusion
    if conclusion.verdict == ADEQUATE:
        return NOTHING_MISSING
    if conclusion.verdict == NOT_TESTABLE:
        return NOTHING_TESTABLE
    best = set(conclusion.best.mechanisms)
    alternatives = _select_hypotheses(evidence)[1:]
    # If the verdict names one mechanism, the name is not ambiguous because of what else
    # may act as well.
    if conclusion.verdict == NAMED:
        alternatives = [h for h in alternatives if not set(h.mechanisms) >= best]
    return "" if alternatives else NOTHING_AMBIGUOUS


def _select_hypotheses(evidence: Evidence) -> list[Hypothesis]:
    """Select the best hypothesis, the other credible ones and those that the verdict
    states as alternatives, by their probability."""
    conclusion = evidence.conclusion
    present = [h for h in conclusion.hypotheses if h.mechanisms and h.model >= 0]
    cumulative = np.cumsum([h.probability for h in present])
    least = evidence.design.settings.credible * cumulative[-1]
    credible = present[: int(np.searchsorted(cumulative, least)) + 1]
    best = conclusion.best
    stated = [
        replace_mechanism(best.mechanisms, name, alternative)
        for name, alternatives in conclusion.alternatives.items()
        for alternative in alternatives
    ]
    others = [h for h in present if h in credible or h.mechanisms in stated]
    return [best, *(h for h in others if h != best)][:_HYPOTHESES]
