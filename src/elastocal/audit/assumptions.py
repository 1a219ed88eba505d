"""Geometry beside compliances: every estimator on the data sets of the study, by pinocchio and singular values.

The unloaded pose moves with errors of joint zeros and link lengths, the loaded one with compliances too. An estimator is a
matrix on both poses. Its noise is that of the measurements through it, its leak what it makes of the true parameters less
these.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.audit.arm import Arm
from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.questions import drawn

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

# Estimates through two pseudo-inverses; a leak is a difference that may be all rounding.
_CLOSE, _NOTHING = 1e-6, 1e-9
_FIXED = re.compile(r"T([xyz])\((-?)([^()]+)\)")


def geometry(run: Audited, file: str, robot: str) -> list[Finding]:
    """Noise and leak of every estimator, mean over all data sets."""
    frame, expected = run.table(file).set_index("estimator"), qualities(run, robot)
    missing = sorted(set(frame.index) ^ set(expected))
    found = [held(file, "estimators", "counting", not missing, f"{missing}", len(expected))]
    for estimator in expected if not missing else ():
        for name, value in expected[estimator].items():
            stored = frame.loc[estimator, name]
            checked = f"{name.replace('_', ' ')}, {estimator}"
            found.append(compared(file, checked, "numpy's pseudo-inverse on pinocchio", stored, value, _CLOSE, _NOTHING))
    return found


@cache
def qualities(run: Audited, robot: str) -> dict[str, dict[str, float]]:
    """Columns of the geometry table by the names of estimators."""
    arm, longer, settings = run.arm(robot), stretched(run, robot), run.configuration
    noise, errors = 1e-6 * settings["tables"]["noise_um"], settings["questions"]["geometry_errors"]
    lengths = longer.joints - arm.joints
    truth = np.concatenate([np.full(arm.joints, errors["zero_rad"]), np.full(lengths, errors["length_m"]), arm.compliance])
    there = np.concatenate(_columns(run, robot, 0, settings["test_configurations"], "test"), axis=2)[:, :3]
    moment = np.einsum("tki,tkj->ij", there, there) / len(there)
    spread: dict[str, Any] = {}
    missed: dict[str, Any] = {}
    for data_set in range(settings["data_sets"]):
        pair = [each.reshape(-1, each.shape[2]) for each in _columns(run, robot, data_set, settings["tables"]["length"])]
        of_geometry, of_springs = pair
        both = np.block([[of_geometry, np.zeros_like(of_springs)], [of_geometry, of_springs]])
        for name, estimator in _estimators(of_geometry, of_springs, both).items():
            wrong = (estimator @ both - np.eye(len(truth))) * truth
            wrong[np.abs(wrong) < _NOTHING * truth[:, None]] = 0.0
            # Errors of geometry are random and of mean zero, compliances the same each time.
            always = wrong[:, longer.joints :].sum(axis=1)
            wrong = wrong[:, : longer.joints]
            spread[name] = spread.get(name, 0) + noise**2 * estimator @ estimator.T
            missed[name] = missed.get(name, 0) + wrong @ wrong.T + np.outer(always, always)
    found = {}
    for name in spread:
        row: dict[str, float] = {}
        for part, total in (("noise", spread[name]), ("leak", missed[name])):
            square = total / settings["data_sets"]
            single = np.sqrt(np.diag(square))
            row[part] = float(np.sqrt(np.trace(moment @ square)))
            row[f"compliance_{part}"] = 100 * _root_mean_square(single[longer.joints :] / arm.compliance)
            row[f"zero_{part}"] = _root_mean_square(single[: arm.joints])
        found[name] = row
    return found


def stretched(run: Audited, robot: str) -> Arm:
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
    run: Audited, robot: str, data_set: int, count: int, purpose: str = "identification"
) -> tuple[np.ndarray, np.ndarray]:
    """Sensitivities of the end-effector's pose to geometry (configurations, 6, n + lengths) and to compliances (..., n)."""
    arm, longer = run.arm(robot), _stretched(run, robot)
    of_geometry, of_springs = [], []
    for angles, wrench in zip(*drawn(run, robot, data_set, count, purpose=purpose), strict=True):
        unmoved = np.concatenate([angles, np.zeros(longer.joints - arm.joints)])
        of_geometry.append(longer.jacobian(unmoved, f"{arm.end_effector} target"))
        of_springs.append(arm.regressor(angles, wrench, arm.end_effector, run.wrench_at))
    return np.array(of_geometry), np.array(of_springs)


def _estimators(of_geometry: np.ndarray, of_springs: np.ndarray, both: np.ndarray) -> dict[str, np.ndarray]:
    """Matrices from unloaded and loaded poses to geometry and compliances, by their names in the file."""
    unloaded, loaded = np.linalg.pinv(of_geometry), np.linalg.pinv(of_springs)
    no_geometry, no_springs = np.zeros_like(unloaded), np.zeros_like(loaded)
    return {
        "at once": np.linalg.pinv(both),
        "geometry from unloaded poses, then compliances": np.block(
            [[unloaded, no_geometry], [-loaded @ of_geometry @ unloaded, loaded]]
        ),
        "compliances from differences": np.block([[unloaded, no_geometry], [-loaded, loaded]]),
        "compliances from loaded poses alone": np.block([[no_geometry, no_geometry], [no_springs, loaded]]),
        "geometry from all poses alone": np.block([[unloaded / 2, unloaded / 2], [no_springs, no_springs]]),
    }


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


_stretched = cache(stretched)
CHECKS = ((re.compile(r"results/geometry/([^/]+)\.parquet"), geometry),)
