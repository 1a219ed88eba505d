"""Which of the six words is said, by what evidence."""

import numpy as np
import pytest

from elastocal.attribution import Attribution
from elastocal.lack_of_fit import LEVEL, LackOfFit
from elastocal.verdict import ADEQUATE, CLASS, LEAST_EXPLAINED, NAMED, NOT_TESTABLE, SEVERAL, UNEXPLAINED, Evidence, word

FITS = LackOfFit(1.0, 0.5, 100, 50)
FITS_NOT = LackOfFit(3.0, 1e-9, 100, 50)
UNKNOWN = LackOfFit(np.nan, np.nan, 100, 0)


def attribution(*alternatives):
    """One effect found, with rivals that these data cannot tell from it."""
    count = len(alternatives)
    return Attribution("e", (), 0.01, alternatives, np.full(count, 10.0), np.zeros(count), np.ones(count, int), 1)


def evidence(tested=5, before=FITS_NOT, after=FITS, missing=(1e-4, 0.0), attributions=(), faults=(), **others):
    return Evidence(tested, before, after, *missing, tuple(attributions), tuple(faults), **others)


BRANCHES = {
    "a fault of the data": ({"faults": ["wrong unit"]}, NAMED),
    "a fault of the data, whatever else": ({"faults": ["wrong unit"], "tested": 0, "attributions": [attribution("a")]}, NAMED),
    "two faults of the data": ({"faults": ["wrong unit", "wrong sign"]}, SEVERAL),
    "no candidate that could be tested": ({"tested": 0}, NOT_TESTABLE),
    "nothing found and nothing left": ({"before": FITS, "missing": (0.0, 0.0)}, ADEQUATE),
    "nothing found, noise unknown": ({"before": UNKNOWN, "after": UNKNOWN}, ADEQUATE),
    "nothing found and much left": ({}, UNEXPLAINED),
    "one effect": ({"attributions": [attribution()]}, NAMED),
    "one effect that has an alternative": ({"attributions": [attribution("a")]}, CLASS),
    "one effect that may sit elsewhere": ({"attributions": [attribution("e@2", "e@3[first order]")]}, NAMED),
    "one effect that may sit elsewhere or be another": ({"attributions": [attribution("e@2", "a")]}, CLASS),
    "one effect that departs from its law": ({"attributions": [attribution()], "doubted": True}, CLASS),
    "one effect that departs from its law and has an alternative": (
        {"attributions": [attribution("a")], "doubted": True},
        CLASS,
    ),
    "two effects that depart from their laws": ({"attributions": [attribution()] * 2, "doubted": True}, SEVERAL),
    "an effect that departs from its law and leaves most": (
        {"attributions": [attribution()], "after": FITS_NOT, "missing": (1e-4, 9e-5), "doubted": True},
        UNEXPLAINED,
    ),
    "a fault of the data that makes an effect depart from its law": ({"faults": ["wrong unit"], "doubted": True}, NAMED),
    "two effects": ({"attributions": [attribution(), attribution()]}, SEVERAL),
    "two effects that have alternatives": ({"attributions": [attribution("a"), attribution("b")]}, SEVERAL),
    "effects that leave most": ({"attributions": [attribution()], "after": FITS_NOT, "missing": (1e-4, 9e-5)}, UNEXPLAINED),
    "effects that leave most of what noise could hide": ({"attributions": [attribution()], "missing": (1e-4, 9e-5)}, NAMED),
    "an effect that leaves some": ({"attributions": [attribution()], "after": FITS_NOT, "missing": (1e-4, 5e-5)}, NAMED),
    "effects that leave some": ({"attributions": [attribution()] * 2, "after": FITS_NOT, "missing": (1e-4, 5e-5)}, SEVERAL),
    "effects where nothing was above the noise": ({"attributions": [attribution()], "missing": (0.0, 0.0)}, NAMED),
}


@pytest.mark.parametrize("branch", BRANCHES)
def test_word_for(branch):
    settings, said = BRANCHES[branch]
    assert word(evidence(**settings)) == said


def test_share_that_is_explained_is_of_the_mean_square():
    assert evidence(missing=(1e-4, 5e-5)).explained == pytest.approx(0.75)
    assert evidence(missing=(1e-4, 0.0)).explained == 1.0
    assert evidence(missing=(0.0, 0.0)).explained == 1.0
    # More is left with than without: nothing is hidden.
    assert evidence(missing=(1e-4, 2e-4)).explained == pytest.approx(-3.0)


def test_half_of_the_mean_square_is_enough():
    left = np.sqrt(1 - LEAST_EXPLAINED)
    one = [attribution()]
    assert word(evidence(attributions=one, after=FITS_NOT, missing=(1.0, left - 1e-9))) == NAMED
    assert word(evidence(attributions=one, after=FITS_NOT, missing=(1.0, left + 1e-9))) == UNEXPLAINED


def test_a_residual_is_rejected_below_the_level_and_never_where_the_noise_is_unknown():
    assert LackOfFit(1.5, LEVEL / 2, 10, 10).rejected and not LackOfFit(1.5, LEVEL, 10, 10).rejected
    assert not UNKNOWN.rejected
    assert LackOfFit(1.5, 0.1, 10, 10).excess == 0.5 and LackOfFit(0.5, 0.9, 10, 10).excess == 0.0
