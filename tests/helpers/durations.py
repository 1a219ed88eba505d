"""How long something takes, asked so that slow, fast and busy machines answer alike."""

import time
from contextlib import contextmanager

# Waiting for longer means that what is waited for never comes: an hour, for what takes
# a minute on a machine that is not busy.
HUNG_S = 3600
# Of CPU time, for what takes milliseconds.
_AT_ONCE_S = 5.0


@contextmanager
def at_once():
    """The block does not work on for ever."""
    begin = time.process_time()
    yield
    assert time.process_time() - begin < _AT_ONCE_S
