"""Does an effect that was found follow its law? What it makes, tested for a part that goes with load, time, angle or size.

A name is only as good as the law behind it: an effect of another kind that looks much like one of the catalogue leaves little
behind, but not at random. It is stronger where the load is high, or one way, or later, as the law that was named is not; or it
has a sign that no such effect can have.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm
from statsmodels.stats.multitest import multipletests

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.screening import by_chance, directions
from elastocal.selection import parameter_slice

# Family-wise over all departures of all effects found. Small, for no law of the catalogue is quite that of a machine.
LEVEL = 0.001
_SHARE = Parameter("share", "1", 1.0)
# Of what it makes: friction that is overcome, play that is taken up, a stop that is reached.
_POWERS = (1, 2, 3)
# Circumstances that vary less than this do not.
_STILL = 1e-9


@dataclass(frozen=True)
class Doubt:
    """An effect that was found and departs from its law.

    Attributes
    ----------
    effect : str
        Key of the candidate.
    departure : str
        How: a clause that says what its size goes with, or which sign is not that of its law.
    p_value : float
        Family-wise.
    """

    effect: str
    departure: str
    p_value: float


def doubts(final, members, observations):
    """Departures of an effect that was found from its law.

    Where several effects were found nothing is checked: what one makes beyond its law another may stand for.

    Parameters
    ----------
    final : Fit
        With all effects found.
    members : sequence of Candidate
        Those found.
    observations : Observations

    Returns
    -------
    list of Doubt
        The most certain of each member, where there is one.
    """
    if len({member.effect for member in members}) != 1:
        return []
    ways = {}
    for member in members:
        for clause, candidate in _ways(final, member).items():
            ways[candidate.key] = (member.key, clause, candidate)
    seen = directions(final, observations, [candidate for _, _, candidate in ways.values()])
    family_wise = multipletests(by_chance(seen), method="sidak")[1]
    departures = [
        Doubt(*ways[candidate.key][:2], float(p_value))
        for (candidate, _), p_value in zip(seen.candidates, family_wise, strict=True)
    ]
    departures += [doubt for member in members for doubt in wrong_signs(final, member)]
    certain = sorted((doubt for doubt in departures if doubt.p_value < LEVEL), key=lambda doubt: -doubt.p_value)
    return list({doubt.effect: doubt for doubt in certain}.values())


def wrong_signs(final, member):
    """Parameters of an effect whose sign is not that of its law.

    Parameters
    ----------
    final : Fit
    member : Candidate

    Returns
    -------
    list of Doubt
        One for each such parameter, however uncertain; by the normal distribution, for the smallest of all parameters.
    """
    values, _ = final.values_of(member.key)
    linear = parameter_slice(final, member.key)[: len(values)]
    deviations = np.sqrt(np.diag(final.covariance)[linear])
    found = []
    for parameter, value, deviation in zip(member.parameters, values, deviations, strict=True):
        if parameter.sign * value < 0 < deviation:
            needed = "positive" if parameter.sign > 0 else "negative"
            p_value = norm.sf(abs(value) / deviation) * len(member.parameters)
            found.append(Doubt(member.key, f"its {parameter.name} should be {needed}", float(p_value)))
    return found


def circumstances_of_a_law(circumstances, joints):
    """What the size of an effect might go with and should not, in each state.

    Parameters
    ----------
    circumstances : Circumstances
    joints : tuple of int
        Of the effect, from 1.

    Returns
    -------
    dict of str to ndarray (S, d)
        Mean zero, mean square one; without those that do not vary.
    """
    weights = {"the load": np.linalg.norm(circumstances.wrench[:, :3], axis=1)[:, None]}
    for name, values in (("the time", circumstances.time_s), ("the temperature", circumstances.temperature_c)):
        if values is not None:
            weights[name] = values[:, None]
    for joint, angle in enumerate(circumstances.joint_angles.T, 1):
        weights[f"the angle of joint {joint}"] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for joint in joints:
        weights[f"the side from which the load turns joint {joint}"] = np.sign(circumstances.load[:, [joint - 1]])
        if circumstances.approach is not None:
            weights[f"the side from which joint {joint} comes"] = np.sign(circumstances.approach[:, [joint - 1]])
    scaled = {name: _scaled(values) for name, values in weights.items()}
    return {name: values for name, values in scaled.items() if values.shape[1]}


def _ways(final, member):
    """Ways in which an effect may depart from its law: what it makes, times circumstances, as a candidate for each clause."""
    made = _made(final, member)
    around = circumstances_of_a_law(final.circumstances, member.joints)
    ways = {
        f"its size goes with {name}": {coordinate: values[:, None] * weights for coordinate, values in made.items()}
        for name, weights in around.items()
    }
    ways["it does not grow as its law does"] = {
        coordinate: values[:, None] * _scaled(_relative(values) ** _POWERS) for coordinate, values in made.items()
    }
    candidates = {clause: _candidate(member, clause, displaced) for clause, displaced in ways.items()}
    return {clause: candidate for clause, candidate in candidates.items() if candidate.parameters}


def _relative(values):
    sizes = np.abs(values)[:, None]
    return sizes / sizes.max(initial=np.finfo(float).tiny)


def _scaled(values):
    """Columns of mean zero and mean square one, without those that do not vary."""
    centred, spread = values - values.mean(axis=0), values.std(axis=0)
    return centred[:, spread > _STILL] / spread[spread > _STILL]


def _made(final, member):
    """Displacement that an effect makes at its fitted size, dict of coordinates to ndarray (S,)."""
    values, shapes = final.values_of(member.key)
    made = {}
    for value, law in zip(values, member.displacement(final.circumstances, *shapes), strict=True):
        for coordinate, per_unit in law.items():
            made[coordinate] = made.get(coordinate, 0.0) + value * per_unit
    return made


def _candidate(member, clause, displaced):
    """A candidate with a parameter for each column of the displacements (S, d); a coordinate may have fewer than another."""
    columns = max(values.shape[1] for values in displaced.values())

    def displacement(circumstances):
        return [
            {c: values[:, column] for c, values in displaced.items() if column < values.shape[1]} for column in range(columns)
        ]

    return Candidate(
        member.effect, member.family, member.joints, f"{member.detail} {clause}", (_SHARE,) * columns, displacement
    )
