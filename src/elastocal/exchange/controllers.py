"""Programs with joint targets in the languages of robot controllers.

`controllers.yaml` describes each language, and a Jinja template beside it is its program,
which moves slowly to all targets. References: KUKA System Software 8.3, Operating and
Programming Instructions for System Integrators (PTP to axis positions); ABB, Technical
reference manual: RAPID Instructions, 3HAC050917 (MoveAbsJ, jointtarget); FANUC, R-30iB
Plus Operator's Manual, B-83284EN (joint positions, ASCII upload); Universal Robots, The
URScript Programming Language for e-Series (movej).
"""

import math
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path

import numpy as np
import yaml
from jinja2 import Environment, PackageLoader, Undefined

from elastocal.counting import format_count
from elastocal.errors import InputError, format_printable
from elastocal.io import plugins


@dataclass(frozen=True)
class JointTargets:
    """Joint targets in the units of controllers.

    Attributes
    ----------
    axes : the controller's names of the joints.
    units : unit of each joint, "deg" or "mm".
    values : targets, (N, n), in deg, and in mm for prismatic joints.
    """

    axes: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray

    def list_by_axis(self) -> list[dict[str, float]]:
        """List the targets, each as its values by the names of the axes."""
        return [
            dict(zip(self.axes, values, strict=True)) for values in self.values.tolist()
        ]


@dataclass(frozen=True)
class Controller:
    """The language of a robot controller.

    Attributes
    ----------
    name : name in options.
    words : name in sentences.
    suffix : suffix of its files.
    axes : its names of the robot's axes.
    external : its names of external axes.
    pattern, pattern_words : regular expression of the names of programs, and the same in
        words.
    write : makes the lines of a program from its name, targets and notes, which
        `format_remarks` turns into comments.
    """

    name: str
    words: str
    suffix: str
    axes: Sequence[str]
    external: Sequence[str]
    pattern: str
    pattern_words: str
    write: Callable[[str, JointTargets, Sequence[str]], list[str]]

    def program(
        self, name: str, targets: JointTargets, notes: Sequence[str] = ()
    ) -> str:
        """Format the text of a file; `check_name` has checked the name."""
        return "\n".join([*self.write(name, targets, notes), ""])


def format_remarks(notes: Sequence[str], longest: int = 100) -> list[str]:
    """Format notes as lines of comments of at most `longest` characters.

    Only characters that no controller reads as syntax are kept: letters and digits of
    ASCII, blanks and ``. , : _ + - / ( )``. All others become question marks.
    """
    lines = []
    for note in notes:
        plain = re.sub(r"[^A-Za-z0-9 .,:_+\-/()]", "?", format_printable(note))
        lines += textwrap.wrap(plain, longest)
    return lines


def _format_decimals(
    value: float | Undefined, digits: int, without_axis: str = ""
) -> str:
    """Format a number, or an axis that the robot does not have."""
    if isinstance(value, Undefined):
        return without_axis
    # Adding zero removes the minus sign of a zero.
    return f"{round(value, digits) + 0.0:.{digits}f}"


_TEMPLATES = Environment(
    loader=PackageLoader(__package__, ""), trim_blocks=True, lstrip_blocks=True
)
_TEMPLATES.filters |= {
    "decimals": _format_decimals,
    "radians": math.radians,
    "remarks": format_remarks,
}


def _fill_template(
    language: str, name: str, targets: JointTargets, notes: Sequence[str]
) -> list[str]:
    """Fill the template of a language; returns the lines of the program."""
    controller = CONTROLLERS[language]
    program = _TEMPLATES.get_template(f"{language}.jinja").render(
        name=name,
        axes=(*controller.axes, *controller.external),
        units=dict(zip(targets.axes, targets.units, strict=True)),
        targets=targets.list_by_axis(),
        notes=notes,
    )
    return program.split("\n")


def _load_controllers() -> dict[str, Controller]:
    """Load the languages of this package, by name."""
    text = resources.files(__package__).joinpath("controllers.yaml").read_text("utf-8")
    return {
        name: Controller(name, **facts, write=partial(_fill_template, name))
        for name, facts in yaml.safe_load(text).items()
    }


CONTROLLERS = _load_controllers()


def list_controllers() -> dict[str, Controller]:
    """List the languages of this package and of other installed packages, by name."""
    return CONTROLLERS | plugins.load_plugins(
        plugins.CONTROLLERS, Controller, CONTROLLERS
    )


def find_controller(name: str) -> Controller:
    """Find a language by its name; raises `InputError` if there is none."""
    if name in CONTROLLERS:
        return CONTROLLERS[name]
    controllers = list_controllers()
    if name not in controllers:
        raise InputError("--format", "", repr(name), " | ".join(controllers))
    return controllers[name]


def check_name(controller: Controller, path: Path) -> str:
    """Return the name of a program, which is that of its file without the suffix; refuse
    one that the language does not allow."""
    name = path.stem
    if not re.fullmatch(controller.pattern, name, re.ASCII):
        raise InputError(
            path,
            "--output",
            f"{name!r} as the name of a program",
            f"in {controller.words}: {controller.pattern_words}",
        )
    return name


def find_axes(
    controller: Controller, prismatic: Sequence[bool], stated: str
) -> tuple[str, ...]:
    """Find the controller's names of q1, q2, ...

    Six revolute joints are the robot's axes in their order, and prismatic joints are
    external axes. For other robots the names must be `stated`, as ``A1,A2,...``: the
    third of seven joints may be an external axis, and a palletizer has four of six.
    """
    all_axes = (*controller.axes, *controller.external)
    joints = f"q1 to q{len(prismatic)}"
    if stated:
        names = tuple(name.strip() for name in stated.split(","))
        is_complete = len(names) == len(set(names)) == len(prismatic)
        if not is_complete or not set(names) <= set(all_axes):
            count = format_count(len(prismatic), "different name")
            raise InputError(
                "--axes",
                "",
                repr(stated),
                f"{count}, of {joints}, of {', '.join(all_axes)}",
            )
        return names
    shifts = sum(prismatic)
    turns = len(prismatic) - shifts
    if turns != len(controller.axes) or shifts > len(controller.external):
        problem = f"{_count_revolute(turns)} and {shifts} that shift"
        if controller.external:
            allowed = (
                f"--axes with what {controller.words} calls each of {joints}:"
                f" {', '.join(all_axes)}"
            )
        else:
            count = _count_revolute(len(controller.axes))
            allowed = f"{count}, which is all that {controller.words} has"
        raise InputError("--format", controller.name, problem, allowed)
    robot_axes = iter(controller.axes)
    external_axes = iter(controller.external)
    return tuple(
        next(external_axes if is_prismatic else robot_axes)
        for is_prismatic in prismatic
    )


def _count_revolute(count: int) -> str:
    return format_count(count, "joint that turns", "joints that turn")


def build_targets(
    joint_angles: np.ndarray, prismatic: Sequence[bool], axes: tuple[str, ...]
) -> JointTargets:
    """Make targets of joint angles (N, n) in rad, and in m for prismatic joints."""
    values = np.where(prismatic, 1e3 * joint_angles, np.degrees(joint_angles))
    units = tuple("mm" if is_prismatic else "deg" for is_prismatic in prismatic)
    return JointTargets(axes, units, values)
