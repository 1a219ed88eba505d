"""Does an effect that was found follow its law? What it makes, tested for a part that goes with load, time or angle.

A name is only as good as the law behind it: an effect of another kind that looks much like one of the catalogue leaves little
behind, but not at random. It is stronger where the load is high, or one way, or later, as the law that was named is not.
"""

from dataclasses import dataclass

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.screening import directions, score

# Family-wise over all circumstances of all effects found.
LEVEL = 0.05
_SHARE = Parameter("share", "1", 1.0)


@dataclass(frozen=True)
class Doubt:
    """An effect that was found and departs from its law.

    Attributes
    ----------
    effect : str
        Key of the candidate.
    circumstance : str
        What its size goes with.
    p_value : float
        Family-wise.
    """

    effect: str
    circumstance: str
    p_value: float


def doubts(final, members, observations, replicates, stream):
    """Departures of an effect that was found from its law.

    Where several effects were found nothing is checked: what one makes beyond its law another may stand for.

    Parameters
    ----------
    final : Fit
        With all effects found.
    members : sequence of Candidate
        Those found.
    observations : Observations
    replicates : int
        Of the bootstrap.
    stream : numpy.random.Generator

    Returns
    -------
    list of Doubt
        The most certain of each member, where there is one.
    """
    if len({member.effect for member in members}) != 1:
        return []
    varied = {}
    for member in members:
        for name, weight in circumstances_of_a_law(final.circumstances, member.joints).items():
            candidate = _varied(final, member, name, weight)
            varied[candidate.key] = (member.key, name, candidate)
    seen = directions(final, observations, [candidate for _, _, candidate in varied.values()])
    scores = score(seen, replicates, stream)
    found = {}
    for index in np.argsort(-scores.p_value):
        if scores.p_family[index] < LEVEL:
            effect, name, _ = varied[seen.candidates[index][0].key]
            found[effect] = Doubt(effect, name, float(scores.p_family[index]))
    return list(found.values())


def circumstances_of_a_law(circumstances, joints):
    """What the size of an effect might go with and should not, in each state.

    Parameters
    ----------
    circumstances : Circumstances
    joints : tuple of int
        Of the effect, from 1; the first two joints of the robot stand for its place in the room where there are none.

    Returns
    -------
    dict of str to ndarray (S,)
        Mean zero, mean square one; without those that do not vary.
    """
    angles = circumstances.joint_angles
    weights = {"the load": np.linalg.norm(circumstances.wrench[:, :3], axis=1)}
    for name, values in (("the time", circumstances.time_s), ("the temperature", circumstances.temperature_c)):
        if values is not None:
            weights[name] = values
    for joint in joints or (1, 2):
        weights[f"cos q{joint}"], weights[f"sin q{joint}"] = np.cos(angles[:, joint - 1]), np.sin(angles[:, joint - 1])
    for joint in joints:
        weights[f"the side from which the load turns joint {joint}"] = np.sign(circumstances.load[:, joint - 1])
        if circumstances.approach is not None:
            weights[f"the side from which joint {joint} comes"] = np.sign(circumstances.approach[:, joint - 1])
    centred = {name: values - values.mean() for name, values in weights.items()}
    return {name: values / values.std() for name, values in centred.items() if values.std() > 1e-9}


def _varied(final, member, name, weight):
    """What an effect makes at its fitted size, times a circumstance, as a candidate of its own."""
    values, shapes = final.values_of(member.key)

    def displacement(circumstances):
        made = {}
        for value, law in zip(values, member.displacement(circumstances, *shapes), strict=True):
            for coordinate, per_unit in law.items():
                made[coordinate] = made.get(coordinate, 0.0) + value * per_unit
        return [{coordinate: total * weight for coordinate, total in made.items()}]

    return Candidate(member.effect, member.family, member.joints, f"{member.detail} x {name}", (_SHARE,), displacement)
