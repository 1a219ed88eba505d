"""Before and after a campaign: plan it, simulate it, check it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.planning.cell import build_cell
from elastocal.application.planning.plan import choose_plan, find_allowed_candidates
from elastocal.application.planning.survey import Survey
from elastocal.campaigns.campaign import OFFSET_STD_M, Target
from elastocal.campaigns.simulation import Plan as SimulatedPlan
from elastocal.campaigns.simulation import draw_measurements
from elastocal.interface.arguments import check_count, check_instance, check_size
from elastocal.interface.campaigns import CAMPAIGN_ALLOWED, ROBOT_ALLOWED, Campaign
from elastocal.loop.overview import Overview, inspect_case
from elastocal.measuring.position import POSITION
from elastocal.mechanics.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from elastocal.application.planning.plan import Plan

# Number of random configurations from which a plan chooses, as of `elastocal plan`.
_CANDIDATES = 10_000


@dataclass(frozen=True, eq=False)
class MeasurementPlan:
    """Where to measure a robot.

    Attributes
    ----------
    chosen : Plan
        Configurations to fit and to validate, and the accuracy that they give.
    survey : Survey
        What is measured in each configuration, and how accurately.
    """

    chosen: Plan = field(repr=False)
    survey: Survey = field(repr=False)

    @property
    def joint_angles(self) -> np.ndarray:
        """(N, n) configurations to fit, rad, as the controller reports them."""
        return self.chosen.fitted.joint_angles

    @property
    def held_out_angles(self) -> np.ndarray:
        """(H, n) random configurations that judge the result."""
        return self.chosen.held_out.joint_angles

    @property
    def predicted_error_m(self) -> float:
        """RMS position error that the parameters of a fit to these configurations leave,
        m, without the tracker's noise."""
        return float(self.chosen.accuracy_m[-1])

    def __repr__(self) -> str:
        return (
            f"<MeasurementPlan: {len(self.joint_angles)} poses to fit and"
            f" {len(self.held_out_angles)} to validate; predicted position error"
            f" {1e3 * self.predicted_error_m:.3f} mm RMS>"
        )


def plan(
    robot: Robot,
    *,
    poses: int = 20,
    held_out: int = 9,
    force_N: float = 0.0,
    targets: Mapping[str, tuple[float, float, float] | None] | None = None,
    seed: int = 1,
) -> MeasurementPlan:
    """Choose where to measure: configurations that determine the parameters best.

    Parameters
    ----------
    robot : Robot
        The nominal robot; its limits and the floor are kept.
    poses, held_out : int
        Numbers of poses to fit and of random ones that judge the result.
    force_N : float
        Weight of a load that hangs from the robot; 0 for none.
    targets : mapping, optional
        Offset of each target at the last measuring point, m; None where it is unknown.
        By default there is one target at an unknown offset.
    seed : int
        Seed of the random configurations.

    Raises
    ------
    InputError
        Names the argument, what was found and what is allowed.
    """
    check_instance("plan", "robot", robot, Robot, ROBOT_ALLOWED)
    check_count("plan", "poses", poses, 1)
    check_count("plan", "held_out", held_out, 0)
    check_count("plan", "seed", seed, 0)
    check_size("plan", "force_N", force_N)
    sensor = POSITION.sensor
    end = robot.chain.end_effector.name
    tracked = tuple(
        Target(name, end, offset_m, offset_std_m=OFFSET_STD_M)
        for name, offset_m in (targets or {"target": None}).items()
    )
    survey = Survey(
        robot,
        tracked,
        unknown_base=True,
        measured="position",
        position_m=sensor.position_m,
        orientation_rad=sensor.orientation_rad,
        force_N=force_N,
    )
    candidates = find_allowed_candidates(survey, build_cell(robot), _CANDIDATES, seed)
    return MeasurementPlan(
        choose_plan(survey, candidates, poses, held_out, seed), survey
    )


def simulate(
    robot: Robot,
    *,
    poses: int = 40,
    force_N: float = 0.0,
    noise_m: float = 1e-5,
    repeats: int = 5,
    seed: int = 1,
) -> pd.DataFrame:
    """Measure a simulated robot at random poses.

    Its joints are elastic as the robot states and otherwise exact: a robot that lacks
    nothing. Change the robot to simulate one that does.

    Parameters
    ----------
    robot : Robot
        The robot that is measured.
    poses : int
        Number of random poses within the joint limits.
    force_N : float
        Force at the last measuring point, in a random direction at each pose.
    noise_m : float
        Standard deviation of each coordinate.
    repeats : int
        How often each of the first five poses is measured.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    DataFrame
        Columns of measurements.csv, see `Campaign.from_table`.

    Examples
    --------
    >>> import elastocal as ec
    >>> robot = ec.read_robot("Rz(q1) Tx(0.3) Rz(q2) Tx(0.2) [tool]")
    >>> table = ec.simulate(robot, poses=8, repeats=1)
    >>> table[["x", "y", "z"]].shape
    (8, 3)
    """
    import pandas as pd

    check_instance("simulate", "robot", robot, Robot, ROBOT_ALLOWED)
    check_count("simulate", "poses", poses, 1)
    check_count("simulate", "repeats", repeats, 1)
    check_count("simulate", "seed", seed, 0)
    check_size("simulate", "force_N", force_N)
    check_size("simulate", "noise_m", noise_m)
    measured = SimulatedPlan(
        points=(robot.chain.end_effector.name,),
        poses=poses,
        force_N=force_N,
        ladder=(0.0, 1.0) if force_N else (0.0,),
        offset_m=(0.0, 0.0, 0.0),
        repeats=repeats,
        repeated_poses=min(5, poses),
        noise_m=noise_m,
        noise_rad=0.0,
    )
    columns: dict[str, Any] = draw_measurements(robot, measured, seed, "simulate")
    table = pd.DataFrame(columns).drop(columns=["rx", "ry", "rz"])
    # A campaign of one target names it itself.
    return table.drop(columns="target")


def check(campaign: Campaign) -> Overview:
    """Say what a campaign identifies and what looks suspicious, before a diagnosis.

    Parameters
    ----------
    campaign : Campaign
        The measurements.
    """
    check_instance("check", "campaign", campaign, Campaign, CAMPAIGN_ALLOWED)
    fitted, held_out = campaign.split()
    return inspect_case(fitted, held_out.campaign.measurements)
