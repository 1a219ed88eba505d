"""Fixtures: chains by their names."""

import pytest
from support import ODD_CHAINS, OTHER_CHAINS, chain_of


@pytest.fixture
def chain_called(kuka, fanuc):
    """A function from the name of a chain, of the paper or of `support`, to the
    chain."""
    paper = {"kuka": kuka.chain, "fanuc": fanuc.chain}
    return lambda name: (
        paper[name] if name in paper else chain_of((OTHER_CHAINS | ODD_CHAINS)[name])
    )
