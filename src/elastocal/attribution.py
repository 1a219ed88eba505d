"""What else could have made the residual: the effect found against every other candidate, for the poses of this campaign."""

from dataclasses import dataclass

import numpy as np

from elastocal.effects.protocol import effect_of
from elastocal.screening import directions
from elastocal.selection import without

# Within this difference of the Bayesian criterion, odds of 4 or 5 to 1, a candidate cannot be told from what was found.
CONFOUNDED_BIC = 3.0
# Beyond this angle a candidate makes less than a quarter of what was found: it may be missing too, but does not stand for it.
UNRELATED_DEG = 60.0


@dataclass(frozen=True)
class Attribution:
    """One mechanism that was found, against all others.

    Attributes
    ----------
    effect : str
        Its name in the catalogue.
    members : tuple of Candidate
        Joints and variants of it that were found.
    p_value : float
        Family-wise, of its strongest member.
    rivals : tuple of str
        Keys of the other candidates.
    angle_deg : ndarray
        Angle of each rival's sensitivities to what was found.
    bic_difference : ndarray
        By how much the criterion is worse with the rival instead.
    rival_parameters : ndarray of int
    found_parameters : int
    """

    effect: str
    members: tuple
    p_value: float
    rivals: tuple
    angle_deg: np.ndarray
    bic_difference: np.ndarray
    rival_parameters: np.ndarray
    found_parameters: int

    @property
    def alternatives(self):
        """Keys of the rivals that these data cannot tell from what was found, the closest first."""
        confounded = (self.bic_difference < CONFOUNDED_BIC) & (self.angle_deg < UNRELATED_DEG)
        order = np.argsort(self.bic_difference)
        return tuple(self.rivals[index] for index in order if confounded[index])

    @property
    def other_effects(self):
        """Names among the alternatives: what was found may sit elsewhere, or be something else."""
        return {effect_of(key) for key in self.alternatives} - {self.effect}


def attribute(final, found, p_values, observations, candidates):
    """Weigh each mechanism found against every other candidate.

    Parameters
    ----------
    final : Fit
        With all effects found.
    found : sequence of Candidate
        Effects found, the strongest first.
    p_values : dict of str to float
        Family-wise p-value of each, by its key.
    observations : Observations
    candidates : sequence of Candidate

    Returns
    -------
    tuple of Attribution
        One for each name of the catalogue among the effects found, in their order.
    """
    return tuple(
        _attribution(name, members, final, [c for c in found if c not in members], p_values, observations, candidates)
        for name, members in by_effect(found).items()
    )


def by_effect(found):
    """Candidates found, gathered by the name of their effect in the order in which the names come.

    Parameters
    ----------
    found : sequence of Candidate

    Returns
    -------
    dict of str to tuple of Candidate
    """
    names = dict.fromkeys(candidate.effect for candidate in found)
    return {name: tuple(candidate for candidate in found if candidate.effect == name) for name in names}


def confounding(seen):
    """Smallest angle between what each two candidates make off the model.

    Parameters
    ----------
    seen : Directions

    Returns
    -------
    ndarray (K, K)
        Degrees.
    """
    sizes = [columns.shape[1] for columns in seen.columns]
    if not sizes:
        # A fault of the data, or data that can test nothing: there is nothing to compare.
        return np.zeros((0, 0))
    ends = np.cumsum(sizes)
    together = np.concatenate(seen.columns, axis=1)
    products = together.T @ together
    cosines = np.ones((len(sizes),) * 2)
    for one in range(len(sizes)):
        for other in range(one):
            block = products[ends[one] - sizes[one] : ends[one], ends[other] - sizes[other] : ends[other]]
            cosines[one, other] = cosines[other, one] = np.linalg.norm(block, 2)
    return np.degrees(np.arccos(np.clip(cosines, 0.0, 1.0)))


def _attribution(name, members, final, others_found, p_values, observations, candidates):
    keys = {member.key for member in members}
    others = without(final, keys, observations)
    taken = {candidate.key for candidate in others_found}
    mine = directions(others, observations, members, 0.0, 0.0)
    # Another form of the same effect at the same joints goes by the same name.
    forms = {(member.effect, member.joints) for member in members}
    rivals = [c for c in candidates if c.key not in taken and (c.effect, c.joints) not in forms]
    seen = directions(others, observations, rivals)
    basis = np.linalg.qr(np.concatenate(mine.columns, axis=1))[0]
    explained = basis @ (basis.T @ seen.residual)
    made = np.linalg.norm(explained)
    # A parameter costs as much as the number of poses says: readings of one pose are no witnesses of their own to a law.
    cost = np.log(len(np.unique(seen.cluster)))
    rows, total = len(seen.residual), seen.residual @ seen.residual
    rest = total - explained @ explained
    rivals, angles, differences, sizes = [], [], [], []
    for index, (candidate, _) in enumerate(seen.candidates):
        columns = seen.columns[index]
        share = np.linalg.norm(columns.T @ explained) / made if made else 0.0
        rest_with = total - ((columns.T @ seen.residual) ** 2).sum()
        rivals.append(candidate.key)
        angles.append(np.degrees(np.arccos(min(share, 1.0))))
        differences.append(rows * np.log(rest_with / rest) + cost * (columns.shape[1] - basis.shape[1]))
        sizes.append(columns.shape[1])
    # Variants of one candidate, as by their shape, count once: the one that fits best.
    order = np.argsort(differences)
    first = [index for place, index in enumerate(order) if rivals[index] not in {rivals[i] for i in order[:place]}]
    return Attribution(
        name,
        members,
        min(p_values[key] for key in keys),
        tuple(rivals[index] for index in first),
        np.array(angles)[first],
        np.array(differences)[first],
        np.array(sizes)[first],
        basis.shape[1],
    )
