"""What goes beside a calibrated robot file: effects that it cannot hold, springs with their errors, conventions in words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal import __version__
from elastocal.application.accuracy import accuracy_sentence
from elastocal.application.calibrated import forward
from elastocal.application.calibrated_geometry import SPRINGS, fold_effects
from elastocal.application.forward_model import model_document

if TYPE_CHECKING:
    from elastocal.application.accuracy import Accuracy
    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions

_CONVENTIONS = {
    "base": "poses are in the robot's base frame: the frame of the chain before its first transform, as the fit placed it",
    "joint_angles": "q = matrix * reported + offset of the robot file, rad; reported angles are the controller's",
    "links": "errors of link k act at its far end, before joint k + 1: Tx Ty Tz Rx Ry Rz in the frame of the chain there",
    "wrench": "external force and moment on the robot at the last measuring point's origin, base axes, N and N m",
    "joint_compliance": "a joint turns by its compliance (rad/(N m)) times the torque of wrench and weight about it",
    "dh": "a row is Rz(theta) Tz(d) Tx(a) Rx(alpha) Ty(b) Ry(beta) from frame k - 1, about whose z axis joint k turns, to "
    "frame k; the first row is from the base, the last to the end effector; b and beta only where axes are nominally parallel; "
    "theta is what the controller's angle is added to",
    "effects": "added to joints and links at the commanded angles; laws by name in the catalogue, elastocal.effects",
}


def sidecar(calibrated: CalibratedRobot, name: str, date: str, accuracy: Accuracy) -> dict[str, Any]:
    """Contents of the sidecar. `name`: of the campaign. `date`: of the export, ISO 8601. `accuracy`: of the corrected robot."""
    deviations = np.sqrt(np.diag(calibrated.covariance))
    kept = fold_effects(calibrated).left_out
    entries, springs, start = [], [], 0
    for number, effect in enumerate(calibrated.model.effects):
        values = np.concatenate([calibrated.estimate.coefficients[number], calibrated.estimate.shapes[number]])
        described = [*((p.name, p.unit) for p in effect.parameters), *((s.name, s.unit) for s in effect.shapes)]
        mine = deviations[start : start + len(values)]
        start += len(values)
        listed = [
            # Held, not known: no error is not an error of 0.
            {"name": label, "unit": unit, "value": float(value), "std_error": float(error) or None}
            for (label, unit), value, error in zip(described, values, mine, strict=True)
        ]
        if effect.effect == SPRINGS:
            springs = listed
        elif number in kept:
            entries.append({"key": effect.key, "effect": effect.effect, "joints": list(effect.joints), "parameters": listed})
    return {
        "campaign": name,
        "robot": calibrated.robot.name,
        "date": date,
        "elastocal_version": __version__,
        "conventions": _CONVENTIONS,
        "accuracy": accuracy.document() | {"words": accuracy_sentence(accuracy)},
        "joint_compliance": springs,
        "effects": entries,
        "forward_model": model_document(calibrated),
    }


def find_left_out_m(calibrated: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions) -> np.ndarray:
    """How far the effects that a robot file cannot hold move the end effector, ndarray (N,), m.

    `calibrated`, `reported_angles`, `operating`: as in `calibrated.forward`.
    """
    kept = set(fold_effects(calibrated).left_out)
    values = tuple(0.0 * v if number in kept else v for number, v in enumerate(calibrated.estimate.coefficients))
    bare = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=values))
    positions = [forward(each, reported_angles, operating)[0] for each in (calibrated, bare)]
    return np.linalg.norm(positions[0] - positions[1], axis=1)
