"""Programs with joint targets in the languages of robot controllers: `CONTROLLERS`, one
entry each.

Each program goes to all targets, slowly. After: KUKA System Software 8.3, Operating and
Programming Instructions for System Integrators (PTP to axis positions); ABB, Technical
reference manual: RAPID Instructions, 3HAC050917 (MoveAbsJ, jointtarget); FANUC, R-30iB
Plus Operator's Manual, B-83284EN (joint positions, ASCII upload); Universal Robots, The
URScript Programming Language for e-Series (movej).
"""

import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from elastocal.counting import format_count
from elastocal.errors import InputError, format_printable
from elastocal.io import plugins


@dataclass(frozen=True)
class JointTargets:
    """Targets (N, n) in degrees, of prismatic joints in mm, by the controller's names
    of the axes, with their ``units``."""

    axes: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray

    def rows(self, names: Sequence[str]) -> list[list[str | None]]:
        """Numbers as all controllers read them, target for target, of these axes; None
        of one that the robot does not have."""
        return [
            [texts.get(name) for name in names]
            for texts in map(self._format_target, self.values)
        ]

    def _format_target(self, values: np.ndarray) -> dict[str, str]:
        """Numbers of one target (n,) by axis. Adding zero removes the minus sign of a
        zero."""
        texts = [f"{round(value, 6) + 0.0:.6f}" for value in values]
        return dict(zip(self.axes, texts, strict=True))


@dataclass(frozen=True)
class Controller:
    """A language: `words` as a person calls it, `suffix` of its files, what it calls
    the axes of the robot and those beside.

    `pattern`, `pattern_words`: of names of programs. `write`: the text of a program
    from its name, targets and notes; `remarks` makes these comments.
    """

    name: str
    words: str
    suffix: str
    axes: tuple[str, ...]
    external: tuple[str, ...]
    pattern: str
    pattern_words: str
    write: Callable[[str, JointTargets, Sequence[str]], list[str]]

    def program(
        self, name: str, targets: JointTargets, notes: Sequence[str] = ()
    ) -> str:
        """The text of the file; the name is one that `check_name` allows."""
        return "\n".join([*self.write(name, targets, notes), ""])


def remarks(
    notes: Sequence[str], mark: str, longest: int = 100, end: str = ""
) -> list[str]:
    """Lines of comments with notes of any text, each behind the language's mark: no
    note is more than a comment.

    What no controller takes for a sign of its language is kept: letters and digits of
    ASCII, blanks and ``. , : _ + - / ( )``.
    """
    plain = [
        "".join(
            c if c.isascii() and (c.isalnum() or c in " .,:_+-/()") else "?"
            for c in format_printable(note)
        )
        for note in notes
    ]
    return [
        f"{mark}{piece}{end}"
        for note in plain
        for piece in textwrap.wrap(note, longest)
    ]


def _krl(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    # A comment that began with FOLD would fold the lines behind it.
    lines = [
        "&ACCESS RVP",
        f"DEF {name}()",
        "  ; joint targets corrected by elastocal, degrees and mm",
        *remarks(notes, "  ; - "),
    ]
    lines += [
        "  INT i",
        "  BAS(#INITMOV, 0)",
        "  FOR i = 1 TO 6",
        "    $VEL_AXIS[i] = 10",
        "  ENDFOR",
    ]
    for row in targets.rows(targets.axes):
        pairs = zip(targets.axes, row, strict=True)
        position = ", ".join(f"{axis} {value}" for axis, value in pairs)
        lines.append(f"  PTP {{E6AXIS: {position}}}")
    return [*lines, "END"]


def _rapid(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    """A module with the targets, and a procedure that goes to all of them with a tool
    of the caller's."""
    rows = targets.rows((*_RAPID_AXES, *_RAPID_EXTERNAL))
    lines = [
        f"MODULE {name}",
        "  ! joint targets corrected by elastocal, degrees and mm",
        *remarks(notes, "  ! "),
    ]
    for number, row in enumerate(rows, 1):
        own = ",".join(value or "0" for value in row[:6])
        beside = ",".join(value or "9E9" for value in row[6:])
        lines.append(f"  CONST jointtarget target_{number} := [[{own}],[{beside}]];")
    lines += ["", "  PROC go_to_targets(PERS tooldata used_tool)"]
    lines += [
        f"    MoveAbsJ target_{number}, v100, fine, used_tool;"
        for number in range(1, len(rows) + 1)
    ]
    return [*lines, "  ENDPROC", "ENDMODULE"]


def _tp(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    """A program of group 1, of which extended axes are too; three axes a line, remarks
    of 32 characters."""
    names = [axis for axis in (*_TP_AXES, *_TP_EXTERNAL) if axis in targets.axes]
    units = dict(zip(targets.axes, targets.units, strict=True))
    rows = targets.rows(names)
    lines = [
        f"/PROG  {name.upper()}",
        "/ATTR",
        'COMMENT\t\t= "elastocal";',
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "/MN",
    ]
    inside = [
        *remarks(notes, "  !", 32, " ;"),
        *(f"J P[{number}] 10% FINE    ;" for number in range(1, len(rows) + 1)),
    ]
    lines += [
        *(f"{number:4d}:{instruction}" for number, instruction in enumerate(inside, 1)),
        "/POS",
    ]
    for number, row in enumerate(rows, 1):
        words = [
            f"{axis}= {value} {units[axis]}"
            for axis, value in zip(names, row, strict=True)
        ]
        inside = [
            ",\t".join(words[first : first + 3]) for first in range(0, len(words), 3)
        ]
        lines += [
            f"P[{number}]{{",
            "   GP1:",
            "\tUF : 0, UT : 1,\t",
            "\t" + ",\n\t".join(inside),
            "};",
        ]
    return [*lines, "/END"]


def _urscript(name: str, targets: JointTargets, notes: Sequence[str]) -> list[str]:
    order = [targets.axes.index(axis) for axis in _UR_AXES]
    lines = [
        f"def {name}():",
        "  # joint targets corrected by elastocal, rad",
        *remarks(notes, "  # "),
    ]
    for row in np.radians(targets.values[:, order]):
        position = ", ".join(f"{round(value, 9) + 0.0:.9f}" for value in row)
        lines.append(f"  movej([{position}], a=0.5, v=0.2)")
    return [*lines, "end"]


_RAPID_AXES = tuple(f"rax_{axis}" for axis in range(1, 7))
_RAPID_EXTERNAL = tuple(f"eax_{axis}" for axis in "abcdef")
_TP_AXES = tuple(f"J{axis}" for axis in range(1, 7))
_TP_EXTERNAL = tuple(f"E{axis}" for axis in range(1, 4))
_UR_AXES = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")
_NAMED = "letters, digits and underscores that begin with"
_CONTROLLERS = (
    Controller(
        name="krl",
        words="KUKA KRL",
        suffix=".src",
        axes=tuple(f"A{axis}" for axis in range(1, 7)),
        external=tuple(f"E{axis}" for axis in range(1, 7)),
        pattern=r"[A-Za-z_]\w{0,23}",
        pattern_words=f"up to 24 {_NAMED} no digit",
        write=_krl,
    ),
    Controller(
        name="rapid",
        words="ABB RAPID",
        suffix=".mod",
        axes=_RAPID_AXES,
        external=_RAPID_EXTERNAL,
        pattern=r"(?!(?i:target_\d+)$)[A-Za-z]\w{0,31}",
        pattern_words=f"up to 32 {_NAMED} a letter",
        write=_rapid,
    ),
    Controller(
        name="tp",
        words="FANUC TP",
        suffix=".ls",
        axes=_TP_AXES,
        external=_TP_EXTERNAL,
        pattern=r"[A-Za-z]\w{0,35}",
        pattern_words=f"up to 36 {_NAMED} a letter",
        write=_tp,
    ),
    Controller(
        name="urscript",
        words="URScript",
        suffix=".script",
        axes=_UR_AXES,
        external=(),
        pattern=r"[A-Za-z_]\w*",
        pattern_words=f"{_NAMED} no digit",
        write=_urscript,
    ),
)
CONTROLLERS = {controller.name: controller for controller in _CONTROLLERS}


def list_controllers() -> dict[str, Controller]:
    """Languages of this package, and those that installed packages offer, by name."""
    return CONTROLLERS | plugins.load_plugins(
        plugins.CONTROLLERS, Controller, CONTROLLERS
    )


def find_controller(name: str) -> Controller:
    """Find a language by its name; `InputError`: there is no such language."""
    if name in CONTROLLERS:
        return CONTROLLERS[name]
    controllers = list_controllers()
    if name not in controllers:
        raise InputError("--format", "", repr(name), " | ".join(controllers))
    return controllers[name]


def check_name(controller: Controller, path: Path) -> str:
    """The name of the program in a file: the file's without its suffix, which an
    InputError refuses where it is none."""
    name = path.stem
    if not re.fullmatch(controller.pattern, name, re.ASCII):
        found = f"{name!r} as the name of a program"
        raise InputError(
            path,
            "--output",
            found,
            f"in {controller.words}: {controller.pattern_words}",
        )
    return name


def axes_of(
    controller: Controller, prismatic: Sequence[bool], stated: str
) -> tuple[str, ...]:
    """Find the controller's names of q1, q2, ...

    Six revolute joints are the robot's axes in their order, and prismatic joints are
    external axes. For other robots the names must be `stated`, as ``A1,A2,...``: the
    third of seven joints may be an external axis, and a palletizer has four of six.
    """
    known = (*controller.axes, *controller.external)
    joints = f"q1 to q{len(prismatic)}"
    if stated:
        names = tuple(name.strip() for name in stated.split(","))
        is_complete = len(names) == len(set(names)) == len(prismatic)
        if not is_complete or not set(names) <= set(known):
            count = format_count(len(prismatic), "different name")
            allowed = f"{count}, of {joints}, of {', '.join(known)}"
            raise InputError("--axes", "", repr(stated), allowed)
        return names
    shifts = sum(prismatic)
    turns = len(prismatic) - shifts
    if turns != len(controller.axes) or shifts > len(controller.external):
        found = f"{_count_revolute(turns)} and {shifts} that shift"
        if controller.external:
            allowed = (
                f"--axes with what {controller.words} calls each of {joints}:"
                f" {', '.join(known)}"
            )
        else:
            count = _count_revolute(len(controller.axes))
            allowed = f"{count}, which is all that {controller.words} has"
        raise InputError("--format", controller.name, found, allowed)
    robot_axes = iter(controller.axes)
    external_axes = iter(controller.external)
    return tuple(
        next(external_axes if is_prismatic else robot_axes)
        for is_prismatic in prismatic
    )


def _count_revolute(count: int) -> str:
    return format_count(count, "joint that turns", "joints that turn")


def targets_of(
    joint_angles: np.ndarray, prismatic: Sequence[bool], axes: tuple[str, ...]
) -> JointTargets:
    """Targets of joint angles (N, n) in rad and, of prismatic joints, m."""
    values = np.where(prismatic, 1e3 * joint_angles, np.degrees(joint_angles))
    return JointTargets(
        axes, tuple("mm" if shift else "deg" for shift in prismatic), values
    )
