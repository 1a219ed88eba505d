"""Where a robot of joint springs yields to, by pinocchio: under its loads and the weights that its file declares, as fitted."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.audited import WRENCH

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from elastocal_proof.audit.audited import Audited

_STANDING = (0.0, 0.0, -9.80665)
_SPRINGS, _WEIGHT = "joint_compliance", "declared_weight"
# The fits take loads where the robot stands after two passes from its commanded pose, and displace it once more.
_OF_FITS = 3
# At the equilibrium another pass moves by less than this (rad, m); each is a hundredth of the one before, or less.
_STILL, _MOST_PASSES = 1e-13, 60


@dataclass(frozen=True)
class Body:
    """A declared mass as fitted: its link, mass (kg) and first moment (kg m) in the frame directly behind the joint."""

    link: int
    mass: float
    moment: np.ndarray


@dataclass(frozen=True)
class Stand:
    """A loaded robot: `position` (3,) of the target at the equilibrium, m; by how much the passes of a fit leave it off that,
    `left_m`; and by how much a standard error of each spring moves it, `slack_m` (3, n).
    """

    position: np.ndarray
    left_m: float
    slack_m: np.ndarray


@dataclass(frozen=True)
class Sagging:
    """The declared model of a campaign of known springs.

    `arms`: one for each target; of an unknown offset at its measuring point. `springs`, `slack` (n,): compliances and their
    standard errors, which are zero of springs that were not fitted, rad/(N m). `gravity` (3,): m/s^2, base axes. `noise_m`:
    with which it was fitted. `complete`: whether all masses that the file declares are among the bodies.
    """

    arms: list[Arm]
    points: list[str]
    springs: np.ndarray
    slack: np.ndarray
    bodies: tuple[Body, ...]
    gravity: np.ndarray
    noise_m: float
    complete: bool

    def standing(self, rows: pd.DataFrame) -> Iterator[Stand]:
        """Where the robot yields to in each row of residuals."""
        angles = rows[[f"q{j}" for j in range(1, self.arms[0].joints + 1)]].to_numpy(float)
        wrenches, targets = rows[list(WRENCH)].to_numpy(float), rows["target"].to_numpy(int)
        for commanded, wrench, target in zip(angles, wrenches, targets, strict=True):
            arm, point = self.arms[target], self.points[target]
            coordinates, of_fits = commanded, commanded
            for number in range(1, _MOST_PASSES + 1):
                last, torques = coordinates, self._torques(arm, coordinates, wrench)
                coordinates = commanded + self.springs * torques
                of_fits = coordinates if number == _OF_FITS else of_fits
                if number >= _OF_FITS and np.abs(coordinates - last).max() < _STILL:
                    break
            position = arm.pose(coordinates, point)[0]
            left = float(np.abs(position - arm.pose(of_fits, point)[0]).max())
            yield Stand(position, left, arm.jacobian(coordinates, f"{point} target")[:3] * (torques * self.slack))

    def _torques(self, arm: Arm, coordinates: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        # In this loop the wrench acts at the last measuring point, whatever is measured.
        total = arm.jacobian(coordinates, arm.end_effector).T @ wrench
        for body in self.bodies:
            behind, rotation = arm.jacobian(coordinates, f"body {body.link}"), arm.rotation(coordinates, f"body {body.link}")
            force, turning = body.mass * self.gravity, np.cross(rotation @ body.moment, self.gravity)
            total = total + behind.T @ np.concatenate([force, turning])
        return total


def sagging(run: Audited, campaign: str) -> Sagging | None:
    """The declared model of a campaign, from its robot file and the estimates of its declared step.

    Returns None where the springs are not known.
    """
    described = run.document(f"results/loop/{campaign}/campaign.json")
    compliance = run.document(f"reports/loop/{campaign}/verdict.json").get("compliance_urad_per_Nm") or {}
    if compliance.get("before") is None:
        return None
    bare = {key: value for key, value in described["robot"].items() if key != "links"}
    targets = list(described["campaign"]["targets"].values())
    arms = [Arm(bare, [0.0] * 3 if each["offset_m"] == "unknown" else each["offset_m"]) for each in targets]
    # A joint that moves twice has two frames behind it.
    complete = not bare.get("masses") or len(re.findall(r"q\d+", bare["chain"])) == arms[0].joints
    fitted, noise = _declared_step(run, campaign)
    springs = 1e-6 * np.array(compliance["before"], float)
    identified = fitted[fitted["owner"] == _SPRINGS]
    slack = np.zeros(len(springs))
    if len(identified):
        springs = identified["value"].to_numpy(float)
        slack = np.where(identified["held"], 0.0, identified["std_error"]).astype(float)
    off = fitted[fitted["owner"] == _WEIGHT].set_index("parameter")["value"]
    bodies = tuple(_body(mass, off) for mass in bare.get("masses", ()) if mass["link"] and complete)
    points, gravity = [str(each["point"]) for each in targets], np.array(bare.get("gravity_m_s2", _STANDING))
    return Sagging(arms, points, springs, slack, bodies, gravity, noise, complete)


def _declared_step(run: Audited, campaign: str) -> tuple[pd.DataFrame, float]:
    """Parameters of the declared step and its noise of positions, m."""
    steps = run.document(f"results/loop/{campaign}/diagnosis.json")["steps"]
    number = next(number for number, step in enumerate(steps) if step["kind"] == "declared")
    table = run.table(f"results/loop/{campaign}/steps.parquet")
    return table[table["step"] == number], float(steps[number]["noise"]["position_m"])


def _body(mass: dict[str, Any], off: pd.Series) -> Body:
    """A mass with its errors as fitted: what is added in mass is added at the centre."""
    link = mass["link"]
    kilograms = mass["mass_kg"] + off.get(f"mass_error_of_link_{link}", 0.0)
    beyond = [off.get(f"moment_error_{axis}_of_link_{link}", 0.0) for axis in "xyz"]
    return Body(link, kilograms, kilograms * np.array(mass["centre_m"], float) + beyond)
