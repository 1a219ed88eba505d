"""What every fault of the data is: a name, in plain words what the readings look like, and how much better they fit without it.

Faults are looked for by the modules of this package, each with

- ``NAMES`` of the faults that it may find and their ``FAMILY``, as in the design's table;
- ``AFTER``, the modules whose decisive faults make it meaningless to look for these;
- ``find(campaign, readings)``, which lists the faults of these names that the readings show.

Nothing else knows the faults by name: a new module is new faults. On doubt none is found: a false alarm stops a trace that
was right, a miss only leaves it to what comes after.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """One number that describes a fault.

    Attributes
    ----------
    name : str
    value : float
    unit : str
        "–" where it has none.
    """

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Fault:
    """A fault that the readings show.

    Attributes
    ----------
    name : str
        One of the ``NAMES`` of a module.
    joints : tuple of int
        Joints concerned, counted from 1; empty where there are none.
    detail : str
        One sentence in plain words.
    parameters : tuple of Value
    evidence : tuple of float
        RMS residual as written and with the correction, m. Where only orientations show the fault: of a point 1 m away.
    rows : tuple of int
        Rows of the file concerned; empty where all are.
    decisive : bool
        Whether the readings must be corrected before anything is traced.
    alternatives : tuple of str
        What would explain the readings as well, in plain words.
    """

    name: str
    joints: tuple
    detail: str
    parameters: tuple
    evidence: tuple
    rows: tuple
    decisive: bool
    alternatives: tuple = ()
