"""What a language of a controller is: a module of this package that has a NAME.

It has ``NAME``, as ``--format`` takes it; ``WORDS``, as a person calls it; ``SUFFIX`` of its files; ``AXES`` and
``EXTERNAL``, what it calls the axes of the robot and those beside them; ``PROGRAM``, a regular expression that a name of a
program matches, and what that is in words; ``RESERVED``, names in lower case that the language has already, between blanks;
``program(name, targets, notes)``, the text of the file, notes being `remarks` in it.
"""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from elastocal.counting import counted
from elastocal.errors import InputError, printable


@dataclass(frozen=True)
class JointTargets:
    """Targets (N, n) in degrees, of prismatic joints in mm, by the controller's names of the axes, with their ``units``."""

    axes: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray

    def rows(self, names: Sequence[str]) -> list[list[str | None]]:
        """Numbers as all controllers read them, target for target, of these axes; None of one that the robot does not have."""
        places = [self.axes.index(name) if name in self.axes else None for name in names]
        return [[None if place is None else f"{round(row[place], 6) + 0.0:.6f}" for place in places] for row in self.values]


class Controller(Protocol):
    """A module of this package, see above."""

    NAME: str
    WORDS: str
    SUFFIX: str
    AXES: tuple[str, ...]
    EXTERNAL: tuple[str, ...]
    PROGRAM: tuple[str, str]
    RESERVED: str

    def program(self, name: str, targets: JointTargets, notes: Sequence[str] = ()) -> str:
        """The text of the file; the name is one that the language allows."""


def remarks(notes: Sequence[str], mark: str, longest: int = 100, end: str = "") -> list[str]:
    """Lines of comments with notes of any text, each behind the language's mark: no note is more than a comment.

    What no controller takes for a sign of its language is kept: letters and digits of ASCII, blanks and ``. , : _ + - / ( )``.
    """
    plain = [
        "".join(c if c.isascii() and (c.isalnum() or c in " .,:_+-/()") else "?" for c in printable(note)) for note in notes
    ]
    return [f"{mark}{piece}{end}" for note in plain for piece in textwrap.wrap(note, longest)]


def check_name(controller: Controller, path: Path) -> str:
    """The name of the program in a file: the file's without its suffix, which an InputError refuses where it is none."""
    pattern, words = controller.PROGRAM
    name = path.stem
    if not re.fullmatch(pattern, name, re.ASCII) or name.lower() in controller.RESERVED.split():
        raise InputError(path, "--output", f"{name!r} as the name of a program", f"in {controller.WORDS}: {words}")
    return name


def axes_of(controller: Controller, prismatic: Sequence[bool], stated: str) -> tuple[str, ...]:
    """What the controller calls q1, q2, ...: as stated, ``A1,A2,...``, or six joints that turn in order and shifts beside them.

    Other robots' axes are a question: whether the third of seven is an external axis, or which of six a palletizer has.
    """
    known = (*controller.AXES, *controller.EXTERNAL)
    if stated:
        names = tuple(name.strip() for name in stated.split(","))
        if len(names) != len(prismatic) or len(set(names)) < len(names) or not set(names) <= set(known):
            allowed = f"{counted(len(prismatic), 'different name')}, of q1 to q{len(prismatic)}, of {', '.join(known)}"
            raise InputError("--axes", "", repr(stated), allowed)
        return names
    shifts = sum(prismatic)
    if len(prismatic) - shifts != len(controller.AXES) or shifts > len(controller.EXTERNAL):
        found = f"{counted(len(prismatic) - shifts, 'joint that turns', 'joints that turn')} and {shifts} that shift"
        if set(known) == set(controller.AXES):
            allowed = f"{len(controller.AXES)} joints that turn, which is all that {controller.WORDS} has"
            raise InputError("--format", controller.NAME, found, allowed)
        allowed = f"--axes with what {controller.WORDS} calls each of q1 to q{len(prismatic)}: {', '.join(known)}"
        raise InputError("--format", controller.NAME, found, allowed)
    turning, shifting = iter(controller.AXES), iter(controller.EXTERNAL)
    return tuple(next(shifting if shift else turning) for shift in prismatic)


def targets_of(joint_angles: np.ndarray, prismatic: Sequence[bool], axes: tuple[str, ...]) -> JointTargets:
    """Targets of joint angles (N, n) in rad and, of prismatic joints, m."""
    values = np.where(prismatic, 1e3 * joint_angles, np.degrees(joint_angles))
    return JointTargets(axes, tuple("mm" if shift else "deg" for shift in prismatic), values)
