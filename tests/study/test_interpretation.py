"""How the paper is read, and how large a study is: plain data that nobody can change behind one's back."""

from dataclasses import FrozenInstanceError

import pytest
from made_studies import SIZE, USUAL


@pytest.mark.parametrize(("what", "name"), [(USUAL, "average"), (SIZE, "noise")])
def test_they_are_frozen(what, name):
    with pytest.raises(FrozenInstanceError):
        setattr(what, name, None)
