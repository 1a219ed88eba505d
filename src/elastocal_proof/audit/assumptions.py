"""Geometry beside compliances: every estimator on the data sets of the study, by pinocchio and singular values.

The unloaded pose moves with errors of joint zeros and link lengths, the loaded one with compliances too. An estimator is a
matrix on both poses. Its noise is that of the measurements through it, its leak what it makes of the true parameters less
these.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.findings import Finding, compare, require
from elastocal_proof.audit.streams import draw

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal_proof.audit.audited import Audited

# Estimates through two pseudo-inverses; a leak is a difference that may be all rounding.
_CLOSE, _NOTHING = 1e-6, 1e-9
_FIXED = re.compile(r"T([xyz])\((-?)([^()]+)\)")


def geometry(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Noise and leak of every estimator, mean over all data sets."""
    frame, expected = run.table(file).set_index("estimator"), qualities(run, robot)
    missing = sorted(set(frame.index) ^ set(expected))
    yield require("estimators", "counting", not missing, f"{missing}", len(expected))
    for estimator, values in expected.items() if not missing else ():
        for name, value in values.items():
            checked, stored = f"{name.replace('_', ' ')}, {estimator}", frame.loc[estimator, name]
            yield compare(checked, "numpy's pseudo-inverse on pinocchio", stored, value, _CLOSE, _NOTHING)


def qualities(run: Audited, robot: str) -> dict[str, dict[str, float]]:
    """Columns of the geometry table by the names of estimators."""
    arm, longer, settings = run.arm(robot), stretch(run, robot), run.configuration
    errors = settings["questions"]["geometry_errors"]
    lengths = np.full(longer.joints - arm.joints, errors["length_m"])
    truth = np.concatenate([np.full(arm.joints, errors["zero_rad"]), lengths, arm.compliance])
    there = np.concatenate(_columns(run, robot, longer, 0, settings["test_configurations"], "test"), axis=2)[:, :3]
    weight = np.einsum("tki,tkj->ij", there, there) / len(there)
    squares: dict[str, dict[str, Any]] = {}
    for data_set in range(settings["data_sets"]):
        pair = _columns(run, robot, longer, data_set, settings["tables"]["length"])
        of_geometry, of_springs = (each.reshape(-1, each.shape[2]) for each in pair)
        both = np.block([[of_geometry, np.zeros_like(of_springs)], [of_geometry, of_springs]])
        for name, estimator in _estimators(of_geometry, of_springs, both).items():
            wrong = (estimator @ both - np.eye(len(truth))) * truth
            wrong[np.abs(wrong) < _NOTHING * truth[:, None]] = 0.0
            # Errors of geometry are random and of mean zero, compliances the same each time.
            always, wrong = wrong[:, longer.joints :].sum(axis=1), wrong[:, : longer.joints]
            total = squares.setdefault(name, {"noise": 0, "leak": 0})
            total["noise"] += run.noise_m**2 * estimator @ estimator.T
            total["leak"] += wrong @ wrong.T + np.outer(always, always)
    found: dict[str, dict[str, float]] = {}
    for name, parts in squares.items():
        for part, total in parts.items():
            square = total / settings["data_sets"]
            single = np.sqrt(np.diag(square))
            relative = 100 * _root_mean_square(single[longer.joints :] / arm.compliance)
            zeros, all_errors = _root_mean_square(single[: arm.joints]), float(np.sqrt(np.trace(weight @ square)))
            found.setdefault(name, {}).update({part: all_errors, f"compliance_{part}": relative, f"zero_{part}": zeros})
    return found


def stretch(run: Audited, robot: str) -> Arm:
    """The robot with a sliding joint behind each of its lengths, so that its Jacobian has columns of lengths too."""
    document, count = run.robots[robot], run.arm(robot).joints
    lengths = document.get("lengths_m", {})

    def with_joint(word: Any) -> str:
        nonlocal count
        if re.fullmatch(r"q\d+", word[3]) or not float(lengths.get(word[3], 0.0) if word[3] in lengths else word[3]):
            return str(word[0])
        count += 1
        return f"{word[0]} T{word[1]}(q{count})"

    chain = _FIXED.sub(with_joint, document["chain"])
    rigid = {key: value for key, value in document.items() if key != "links"}
    return Arm(rigid | {"chain": chain, "compliance_urad_per_Nm": [0.0] * count}, run.arm(robot).tool)


def _columns(
    run: Audited, robot: str, longer: Arm, data_set: int, count: int, purpose: str = "identification"
) -> tuple[np.ndarray, np.ndarray]:
    """Sensitivities of the end-effector's pose to geometry (configurations, 6, n + lengths) and to compliances (..., n)."""
    arm, end = run.arm(robot), run.arm(robot).end_effector
    pairs = list(zip(*draw(run, robot, data_set, count, purpose), strict=True))
    unmoved = [np.concatenate([angles, np.zeros(longer.joints - arm.joints)]) for angles, _ in pairs]
    of_geometry = [longer.jacobian(angles, f"{end} target") for angles in unmoved]
    return np.array(of_geometry), np.array([arm.regressor(*pair, end, run.wrench_at) for pair in pairs])


def _estimators(of_geometry: np.ndarray, of_springs: np.ndarray, both: np.ndarray) -> dict[str, np.ndarray]:
    """Matrices from unloaded and loaded poses to geometry and compliances, by their names in the file."""
    unloaded, loaded = np.linalg.pinv(of_geometry), np.linalg.pinv(of_springs)
    no_geometry, no_springs = np.zeros_like(unloaded), np.zeros_like(loaded)
    first, then = [unloaded, no_geometry], [-loaded @ of_geometry @ unloaded, loaded]
    return {
        "at once": np.linalg.pinv(both),
        "geometry from unloaded poses, then compliances": np.block([first, then]),
        "compliances from differences": np.block([first, [-loaded, loaded]]),
        "compliances from loaded poses alone": np.block([[no_geometry, no_geometry], [no_springs, loaded]]),
        "geometry from all poses alone": np.block([[unloaded / 2, unloaded / 2], [no_springs, no_springs]]),
    }


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


CHECKS = {"results/geometry/{robot}.parquet": geometry}
