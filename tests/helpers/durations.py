"""Limits of durations that hold on slow, fast and busy machines."""

import time
from contextlib import contextmanager

# After this time a process counts as hung. An hour is ample for runs that take a minute
# on an idle machine.
HUNG_S = 3600
# CPU time that is ample for work of milliseconds.
_AT_ONCE_S = 5.0


@contextmanager
def at_once():
    """Check that the block does not take long."""
    begin = time.process_time()
    yield
    assert time.process_time() - begin < _AT_ONCE_S
