"""Wrong ratio of a gear, or coupling from a joint before it: the controller divides the motor's angle by a wrong number.

theta_i = e_i q_i + e_ih q_h, h = i - 1, with theta and q in rad and e in rad/rad (m and m/m for prismatic joints): linear in
the angle and not periodic. Derived here: a motor turns by N_i q_i + N_ih q_h, so that errors of both numbers turn the joint by
-(dN_i q_i + dN_ih q_h) / N_i. In a wrist whose last two motors sit in the forearm and drive through hollow shafts both joints
follow the first wrist joint: as an alternative theta_i = e_ih q_h alone, with h that joint.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "transmission_ratio", "transmission"
MOVES_ROBOT = True
WORDS = "gear ratio or coupling error"
_WRIST = 3
DETAIL_WORDS = {f"from {number}": f"coupling from joint {number} alone" for number in range(1, 10)}


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint, and each of the last two joints as driven through the first of the wrist alone."""
    n, first = sites.joints, sites.joints - _WRIST
    own = [_candidate(sites, joint, [joint, joint - 1][: joint + 1], "") for joint in range(n)]
    through = [joint for joint in (n - 2, n - 1) if first >= 0 and not any(sites.prismatic[first:])]
    return [*own, *(_candidate(sites, joint, [first], f"from {first + 1}") for joint in through)]


def _candidate(sites: Sites, joint: int, sources: Sequence[int], detail: str) -> Candidate:
    # A spindle has a pitch of its own, but is not coupled to what turns.
    alike = [source for source in sources if sites.prismatic[source] == sites.prismatic[joint]]
    unit = "m/m" if sites.prismatic[joint] else "rad/rad"
    parameters = sized(NAME, "per turn", [f"per_q{source + 1}" for source in alike], unit, sites)

    def displacement(conditions: Conditions) -> Displacements:
        return [{joint: conditions.joint_angles[:, source]} for source in alike]

    return Candidate(NAME, FAMILY, (joint + 1,), detail, parameters, displacement, fixed=True)
