"""The next experiment: poses and loads after which the measurements, most probably, say
which hypothesis holds.

Each pose is read at the campaign's targets without its load and under it. Loads are
those of the campaign, made as large as its largest or as the rated payload.

A hypothesis, in its most probable model, is linear in its coefficients: where present
measurements leave these normal with mean m and covariance C, new rows A are expected
with mean A m and covariance I + A C A'. How far the best hypothesis and another one are
apart is eight times the Bhattacharyya distance of both predictions (Kailath, IEEE
Transactions on Communication Technology 1967): their squared Mahalanobis distance, or
twice the expected log Bayes factor, where both predict as surely. Of random poses those
are chosen, one after the other, that make the bound on the probability of a wrong
choice least, the sum of sqrt(p q) exp(-separation / 8). What earlier poses will tell is
taken off by conditioning on them, as a Kalman filter does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import g as standard_gravity
from scipy.special import ndtr

from elastocal.diagnosis.refit import predict_reduced_chi_square
from elastocal.diagnosis.statistics import assemble_normal_equations
from elastocal.diagnosis.verdict import (
    ADEQUATE,
    NAMED,
    NOT_TESTABLE,
    Evidence,
    Hypothesis,
)
from elastocal.fitting.model import evaluate_conditions
from elastocal.fitting.observations import Observations, States
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.search import ScoredModel
    from elastocal.fitting.model import Model as FittedModel
    from elastocal.mechanics.robot import Robot

# Said where nothing within reach helps.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING = "nothing is missing"
NOTHING_AMBIGUOUS = "nothing is ambiguous"
DATA_AT_FAULT = "the data are at fault"
NOTHING_TESTABLE = "the measurements can test no mechanism"
# Random poses that are chosen from, and hypotheses between which they decide; the
# others hold a few per cent.
_DRAWN = 200
_HYPOTHESES = 6
# Poses after which nobody goes on: some two days with a tracker.
_MOST_POSES = 100
# Odds of the right hypothesis against another one with which it counts as resolved.
_SURE_ODDS = 19.0


def draw_candidate_experiments(
    states: States, robot: Robot, count: int, stream: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Random joint angles (E, n), rad, within reach, and the heavier loads of a
    campaign at its last measuring point (E, 6)."""
    low, high = np.clip(robot.joint_limits, -np.pi, np.pi).T
    angles = low + (high - low) * stream.random((count, len(low)))
    size = np.linalg.norm(states.wrench[:, :3], axis=1)
    if not size.any():
        return angles, np.zeros((count, 6))
    heavy = np.flatnonzero(size >= np.median(size[size > 0]))
    chosen = heavy[stream.integers(0, len(heavy), count)]
    largest = max(size.max(), (robot.payload_kg or 0.0) * standard_gravity)
    return angles, states.wrench[chosen] * (largest / size[chosen])[:, None]


def build_planned_observations(
    model: FittedModel, own: States, angles: np.ndarray, wrench: np.ndarray
) -> Observations:
    """Entries as observations with zeros measured, those of an entry together, joints
    approached from either side in turn.

    `own`: states of the campaign, which go on where the last of them is.
    """
    # Without the load, and under it.
    shares = np.array([0.0, 1.0] if own.wrench[:, :3].any() else [1.0])
    entry = np.repeat(np.arange(len(angles)), len(shares))
    load = np.tile(np.arange(len(shares)), len(angles))
    count = len(entry)
    targets = len(model.targets)
    side = np.where(
        np.add.outer(np.arange(count), np.arange(angles.shape[1])) % 2, -1.0, 1.0
    )
    last = {
        name: np.repeat(values[-1:], count, axis=0)
        for name, values in vars(own).items()
        if values is not None
    }
    new = {
        "pose": entry,
        "load": load,
        "joint_angles": angles[entry],
        "wrench": wrench[entry] * shares[load, None],
    }
    new |= {"repeats": np.ones(count, int)} | (
        {} if own.approach is None else {"approach": side}
    )
    state = np.repeat(np.arange(count), targets)
    target = np.tile(np.arange(targets), count)
    rotation = np.tile(np.eye(3), (len(target), 1, 1)) if model.rows == 6 else None
    return Observations(
        States(**last | new), state, target, np.zeros((len(target), 3)), rotation
    )


def compute_whitened_rows(
    linearized: CandidateDesign,
    observations: Observations,
    columns: np.ndarray,
    pose_error_rad: float,
) -> np.ndarray:
    """Sensitivities of entries to declared parameters and some columns, in those of
    `products`, over the noise, (E, R, U)."""
    about = linearized.reference_fit
    products = linearized.products
    # Nothing comes after the last row of the campaign but these.
    around = evaluate_conditions(about.model, about.estimate, observations.states)
    around = replace(around, progress=np.ones(len(observations.states)))
    about = replace(about, weights=np.ones(len(observations)))
    seen = replace(
        linearized, reference_fit=about, observations=observations, around=around
    ).rows
    basis = seen.declared @ products.basis_transform
    beside = (
        seen.candidates.dense()[..., columns] - basis @ products.projections[:, columns]
    )
    entries = seen.pose.max() + 1
    rows = np.concatenate([basis, beside], axis=-1).reshape(
        entries, -1, basis.shape[-1] + len(columns)
    )
    jacobian = seen.jacobian.reshape(entries, rows.shape[1], -1)
    covariance = np.eye(
        rows.shape[1]
    ) + pose_error_rad**2 * jacobian @ jacobian.swapaxes(1, 2)
    return np.linalg.solve(np.linalg.cholesky(covariance), rows)


def compute_coefficient_posteriors(
    linearized: CandidateDesign,
    columns: np.ndarray,
    models: Sequence[ScoredModel],
    factor: float,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Mean (U,) and covariance (U, U) of declared parameters and columns under each
    model; zero for what it does not have.

    At the pose error of the first one, in units of `factor` times the noise taken.
    Half-normal priors count as normal ones.
    """
    count = linearized.products.declared_count
    found = []
    declared = np.arange(count)
    total = (
        assemble_normal_equations(
            linearized.products, models[0].pose_error_rad, columns
        )
        / factor**2
    )
    for model in models:
        mine, deviations = linearized.problem.scaled_columns(
            model.term_indices, model.scales
        )
        at = np.append(declared, count + np.searchsorted(columns, mine))
        precision = total[np.ix_(at, at)] + np.diag(
            np.append(0.0 * declared, (factor * deviations) ** -2)
        )
        covariance = np.zeros((len(total) - 1, len(total) - 1))
        covariance[np.ix_(at, at)] = np.linalg.inv(precision)
        found.append((covariance @ total[:-1, -1], covariance))
    return found


@dataclass(frozen=True)
class HypothesisPair:
    """Two hypotheses after some experiments.

    `apart` (U,): difference of their means. `covariances` (3, U, U): the mean of both,
    and each. `separation`: of what was measured.
    """

    apart: np.ndarray
    covariances: np.ndarray
    separation: float = 0.0

    @classmethod
    def of(
        cls, one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]
    ) -> HypothesisPair:
        """Of two normal distributions of the coefficients."""
        return cls(
            one[0] - other[0], np.array([(one[1] + other[1]) / 2, one[1], other[1]])
        )

    def gained(self, rows: np.ndarray) -> np.ndarray:
        """By how much each of some further experiments (E, R, U) separates them more,
        (E,)."""
        predicted = np.eye(rows.shape[1]) + rows @ self.covariances[
            :, None
        ] @ rows.swapaxes(1, 2)
        off = (rows @ self.apart)[..., None]
        squares = (off * np.linalg.solve(predicted[0], off)).sum(axis=(1, 2))
        return squares + np.array([4.0, -2.0, -2.0]) @ np.linalg.slogdet(predicted)[1]

    def after(self, rows: np.ndarray) -> HypothesisPair:
        """Both after one experiment (R, U), on average over what it may measure."""
        seen = rows @ self.covariances
        gain = np.linalg.solve(np.eye(len(rows)) + seen @ rows.T, seen).swapaxes(1, 2)
        separation = self.separation + float(self.gained(rows[None])[0])
        return HypothesisPair(
            self.apart - gain[0] @ (rows @ self.apart),
            self.covariances - gain @ seen,
            separation,
        )


def select_experiments(
    pairs: Sequence[HypothesisPair], weights: np.ndarray, rows: np.ndarray, count: int
) -> tuple[list[int], np.ndarray]:
    """So many experiments, each the best after those before it, and the separation of
    each pair after each, (count, pairs).

    `weights` (pairs,): of each pair in the bound. `rows` (E, R, U): of what is chosen
    from.
    """
    chosen = list[int]()
    separations = []
    present = list(pairs)
    for _ in range(count):
        bound = weights @ np.exp(
            [-(pair.separation + pair.gained(rows)) / 8.0 for pair in present]
        )
        bound[chosen] = np.inf
        chosen.append(int(np.argmin(bound)))
        present = [pair.after(rows[chosen[-1]]) for pair in present]
        separations.append([pair.separation for pair in present])
    return chosen, np.array(separations)


def compute_resolution_probability(separation: np.ndarray | float) -> np.ndarray:
    """Probability that the right one of two hypotheses gets odds of 19:1 from even
    ones: the log Bayes factor is normal with this variance and half of it as its mean,
    where both predict as surely."""
    size = np.maximum(separation, 1e-12)
    return np.asarray(ndtr((0.5 * size - np.log(_SURE_ODDS)) / np.sqrt(size)))


def propose_experiment(
    diagnosis: Diagnosis, stream: np.random.Generator, poses: int = 10
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Choose the poses and loads that most probably resolve what a diagnosis leaves
    ambiguous.

    Returns columns of the table of poses, in the order of their worth: ``effect``, the
    best hypothesis and the nearest other; ``pose``; ``point``, at which targets are
    read; joint angles as the controller reports them (rad); the load; and what they and
    all before them promise, ``separation`` from the nearest other and the probability
    ``resolved`` that follows from it. And what verdict.json says: ``reason`` why there
    is nothing to measure, and what is ``indistinguishable`` from the best by any
    experiment within reach, which the promise leaves aside.
    """
    campaign = diagnosis.case.campaign
    evidence = diagnosis.evidence
    if evidence is None:
        return _stated(campaign.robot, (), DATA_AT_FAULT)
    kept, reason = _ambiguous(evidence)
    best = evidence.conclusion.best.mechanisms
    others = kept[1:]
    if reason:
        return _stated(campaign.robot, best, reason)
    linearized = evidence.linearized
    model = diagnosis.final.model
    states = diagnosis.case.observations.states
    models = [evidence.posterior.models[each.model] for each in kept]
    factor = float(
        np.sqrt(max(predict_reduced_chi_square(linearized.problem, models[0]), 1.0))
    )
    columns = np.unique(
        np.concatenate(
            [
                linearized.problem.scaled_columns(each.term_indices, each.scales)[0]
                for each in models
            ]
        )
    )
    angles, wrench = draw_candidate_experiments(states, campaign.robot, _DRAWN, stream)
    rows = (
        compute_whitened_rows(
            linearized,
            build_planned_observations(model, states, angles, wrench),
            columns,
            models[0].pose_error_rad,
        )
        / factor
    )
    leading, *following = compute_coefficient_posteriors(
        linearized, columns, models, factor
    )
    pairs = [HypothesisPair.of(leading, each) for each in following]
    probabilities = np.array([each.probability for each in others])
    chosen, separations = select_experiments(
        pairs, np.sqrt(kept[0].probability * probabilities), rows, poses
    )
    whole = np.sqrt(_MOST_POSES / poses) * rows[chosen].reshape(1, -1, rows.shape[-1])
    reached = np.array(
        [
            bool(compute_resolution_probability(pair.gained(whole)[0]) >= 0.5)
            for pair in pairs
        ]
    )
    unreachable = [
        each.mechanisms
        for each, within in zip(others, reached, strict=True)
        if not within
    ]
    # What is distinguishable from the best holds no more probability than is left open
    # where nothing is ambiguous.
    left = kept[0].probability / (kept[0].probability + probabilities[reached].sum())
    if unreachable and left >= linearized.settings.credible:
        return _stated(campaign.robot, best, NOT_DISTINGUISHABLE, unreachable)
    nearest = int(np.argmin(np.where(reached, separations[-1], np.inf)))
    point = " ".join(dict.fromkeys(target.point for target in model.targets))
    table = angles[chosen], wrench[chosen], point, separations[:, reached].min(axis=1)
    return _stated(
        campaign.robot, best, "", unreachable, others[nearest].mechanisms, table
    )


def _stated(
    robot: Robot,
    best: tuple[str, ...],
    reason: str,
    indistinguishable: Sequence[tuple[str, ...]] = (),
    nearest: tuple[str, ...] = (),
    table: tuple[np.ndarray, np.ndarray, str, np.ndarray] | None = None,
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    angles, wrench, point, separation = table or (
        np.zeros((0, robot.joints)),
        np.zeros((0, 6)),
        "",
        np.zeros(0),
    )
    count = len(angles)
    columns = {
        "effect": np.full(count, f"{' + '.join(best)} or {' + '.join(nearest)}"),
        "pose": np.arange(count),
        "point": np.full(count, point),
        **{
            f"q{joint}": angle
            for joint, angle in enumerate(robot.reported_angles(angles).T, 1)
        },
        **dict(zip(WRENCH_NAMES, wrench.T, strict=True)),
        "separation": separation,
        "resolved": compute_resolution_probability(separation),
    }
    last = {
        name: float(columns[name][-1]) if count else None
        for name in ("separation", "resolved")
    }
    names = {
        "best": list(best),
        "nearest": list(nearest),
        "indistinguishable": [list(name) for name in indistinguishable],
    }
    return columns, {"poses": count, "reason": reason} | names | last


def _ambiguous(evidence: Evidence) -> tuple[list[Hypothesis], str]:
    """Credible hypotheses, the best first; or why there is nothing to resolve."""
    conclusion = evidence.conclusion
    if conclusion.verdict in (ADEQUATE, NOT_TESTABLE):
        return (
            [],
            NOTHING_MISSING if conclusion.verdict == ADEQUATE else NOTHING_TESTABLE,
        )
    there = [
        each for each in conclusion.hypotheses if each.mechanisms and each.model >= 0
    ]
    reached = np.cumsum([each.probability for each in there])
    credible = there[
        : int(
            np.searchsorted(
                reached, evidence.linearized.settings.credible * reached[-1]
            )
        )
        + 1
    ]
    best = conclusion.best
    found = [best, *(each for each in credible if each != best)][:_HYPOTHESES]
    # Where the verdict names one mechanism, whatever else is beside it does not make
    # the name ambiguous.
    instead = [
        each for each in found[1:] if not set(each.mechanisms) >= set(best.mechanisms)
    ]
    if len(found) < 2 or (conclusion.verdict == NAMED and not instead):
        return [], NOTHING_AMBIGUOUS
    return found, ""
