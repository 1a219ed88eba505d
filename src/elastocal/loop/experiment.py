"""Step 5: the next experiment as a table that a robot operator can work from."""

import pandas as pd

from elastocal.next_experiment import propose
from elastocal.study.columns import WRENCH_NAMES


def proposal_frame(case, final, attributions, states, draws, ladder=None):
    """States that best tell each effect found from its alternatives; no rows where nothing is confounded.

    Parameters
    ----------
    case : Case
    final : Fit
    attributions : sequence of Attribution
    states : int
        For each effect that is confounded.
    draws : numpy.random.Generator
    ladder : tuple of float, optional
        Shares of its load at which each pose is read, see `propose`; the rows are then poses, with the load at the share 1.

    Returns
    -------
    pandas.DataFrame
        Joint angles as the controller reports them (rad).
    """
    robot = case.campaign.robot
    angles = [f"q{joint + 1}" for joint in range(robot.joints)]
    names = ["effect", "pose", "load", "point", *angles, *WRENCH_NAMES, "separation", "separation_without"]
    rows = []
    for attribution in attributions:
        if not attribution.alternatives:
            continue
        found = propose(final, attribution, case.observations, case.candidates, robot.joint_limits, states, draws, ladder)
        reported = robot.reported_angles(found.joint_angles)
        for number in range(states):
            loaded = int(found.wrench[number].any())
            values = (*reported[number], *found.wrench[number], found.separation[number], found.present)
            rows.append((attribution.effect, number, loaded, found.point[number], *values))
    return pd.DataFrame(rows, columns=names)
