"""Programs state all targets; forbidden program names and unclear axes are refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from made_targets import ANGLES, RAIL, make_targets, numbers
from support import refused

from elastocal.exchange.controllers import (
    CONTROLLERS,
    check_name,
    find_axes,
    find_controller,
)

ALL = CONTROLLERS
SIX = (False,) * 6
# What a line, or in TP a block, of a target begins with, and what the whole begins and
# ends with.
TARGET = {
    "krl": r"  PTP .*",
    "rapid": r"  CONST .*",
    "tp": r"(?s)P\[\d\]\{.*?\};",
    "urscript": r"  movej.*",
}
WHOLE = {
    "krl": ("&ACCESS RVP\nDEF go()\n", "\nEND\n"),
    "rapid": ("MODULE go\n", "  ENDPROC\nENDMODULE\n"),
    "tp": ("/PROG  GO\n/ATTR\n", "};\n/END\n"),
    "urscript": ("def go():\n", "\nend\n"),
}


def targets(name, **options):
    text = ALL[name].program("go", make_targets(ALL[name], **options))
    assert text.startswith(WHOLE[name][0]) and text.endswith(WHOLE[name][1])
    return re.findall(TARGET[name], text), text


def test_a_language_is_found_by_its_name():
    suffixes = {"krl": ".src", "rapid": ".mod", "tp": ".ls", "urscript": ".script"}
    assert {name: target_text.suffix for name, target_text in ALL.items()} == suffixes
    assert all(find_controller(name) is controller for name, controller in ALL.items())
    with refused("--format", "'karel'", "krl"):
        find_controller("karel")


@pytest.mark.parametrize("name", ALL)
def test_programs_state_targets_to_a_microdegree(name):
    targets_in_text, text = targets(name)
    read = np.array([numbers(target_text)[:6] for target_text in targets_in_text])
    np.testing.assert_allclose(
        read if name == "urscript" else np.radians(read), ANGLES, atol=1e-8
    )
    moves = {
        "rapid": r"MoveAbsJ target_(\d), v100, fine",
        "tp": r" \d:J P\[(\d)\] 10% FINE    ;",
    }.get(name)
    assert moves is None or re.findall(moves, text) == ["1", "2", "3", "4"]


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("krl", "{{E6AXIS: E1 {}, A1"),
        ("rapid", "],[{},9E9,9E9,9E9,9E9,9E9]];"),
        ("tp", ",\n\tE1= {} mm"),
    ],
)
def test_a_rail_is_the_first_external_axis_in_millimetres(name, written):
    targets_in_text, _ = targets(name, rail=True)
    for target, rail_position in zip(targets_in_text, RAIL[:, 0], strict=True):
        assert written.format(f"{1e3 * rail_position:.6f}") in target


@pytest.mark.parametrize("name", ALL)
def test_a_forbidden_program_name_is_refused(name):
    reserved_names = ["TARGET_3"] if name == "rapid" else []
    longest = [] if name == "urscript" else ["x" * 40]
    for stem in ("1st", "my targets", "größe", "a-b", *longest, *reserved_names):
        with refused(stem, "name of a program", ALL[name].words):
            check_name(ALL[name], Path(stem + ALL[name].suffix))
    assert check_name(ALL[name], Path("out/targets_2.any")) == "targets_2"


def test_axes_of_six_joints_and_a_rail_are_found_and_others_must_be_stated():
    assert find_axes(ALL["krl"], (True, *SIX), "") == (
        "E1",
        "A1",
        "A2",
        "A3",
        "A4",
        "A5",
        "A6",
    )
    assert find_axes(ALL["rapid"], (True, True, *SIX), "")[:3] == (
        "eax_a",
        "eax_b",
        "rax_1",
    )
    assert find_axes(ALL["tp"], (*SIX, True), "")[-2:] == ("J6", "E1")
    for prismatic in ((False,) * 7, (False,) * 4, (True,) + (False,) * 5):
        with refused("--format", "joints that turn", "--axes", "A1", "E1"):
            find_axes(ALL["krl"], prismatic, "")
    with refused("--format", "joints that turn", "6 joints", "URScript"):
        find_axes(ALL["urscript"], (False,) * 7, "")
    stated = ("A1", "A2", "E1", "A3", "A4", "A5", "A6")
    assert find_axes(ALL["krl"], (False,) * 7, ", ".join(stated)) == stated
    for wrong in ("A1,A2", "A1,A1,A2,A3,A4,A5,A6", "J1,A2,E1,A3,A4,A5,A6"):
        with refused("--axes", wrong, "7 different names"):
            find_axes(ALL["krl"], (False,) * 7, wrong)
