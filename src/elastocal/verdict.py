"""What is said of a campaign in the end: one of six words, with the figures behind it."""

from dataclasses import dataclass

ADEQUATE, NAMED, CLASS, SEVERAL = "adequate", "named", "class", "several"
UNEXPLAINED, NOT_TESTABLE = "unexplained", "not_testable"
# Effects that leave more than this share of what was above the noise have not explained it.
LEAST_EXPLAINED = 0.5


@dataclass(frozen=True)
class Evidence:
    """What the verdict rests on.

    Attributes
    ----------
    tested : int
        Candidates that these data could test.
    before, after : LackOfFit
        Of the declared model and of the model with the effects found.
    discrepancy_before_m, discrepancy_after_m : float
        What both models lack beside the noise, see `Fit`.
    attributions : tuple of Attribution
    data_faults : tuple of Fault
        Decisive ones.
    doubted : bool
        Whether the effect found departs from its law, see `law_check`.
    """

    tested: int
    before: object
    after: object
    discrepancy_before_m: float
    discrepancy_after_m: float
    attributions: tuple
    data_faults: tuple = ()
    doubted: bool = False

    @property
    def explained(self):
        """Share of the mean square beside the noise that the effects found have removed; 1 where there was none."""
        before = self.discrepancy_before_m**2
        return 1.0 - self.discrepancy_after_m**2 / before if before else 1.0


def word(evidence):
    """The verdict.

    Parameters
    ----------
    evidence : Evidence

    Returns
    -------
    str
        adequate: nothing is missing that these data could show. named: one effect, told from all others, if not always where it
        sits. class: one effect or one of those that these data cannot tell from it, or something akin to it that departs from
        its law. several: more than one effect. unexplained: the residual is more than noise and no effect of the catalogue
        accounts for it. not_testable: the data can test nothing.
    """
    if evidence.data_faults:
        return NAMED if len(evidence.data_faults) == 1 else SEVERAL
    if not evidence.tested:
        return NOT_TESTABLE
    if not evidence.attributions:
        return UNEXPLAINED if evidence.before.rejected else ADEQUATE
    if evidence.after.rejected and evidence.explained < LEAST_EXPLAINED:
        return UNEXPLAINED
    if len(evidence.attributions) > 1:
        return SEVERAL
    return CLASS if evidence.attributions[0].other_effects or evidence.doubted else NAMED
