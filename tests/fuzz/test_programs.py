"""A controller program contains the statements of its targets and no others, whatever
the names of the robot, the campaign and the tool are."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_targets import make_targets

from elastocal.exchange.controllers import CONTROLLERS

STATEMENTS = [
    "\r\n",
    "END",
    "ENDPROC",
    "end",
    "/POS",
    "/END",
    "*/",
    "//",
    "PTP {A1 0}",
    "MoveAbsJ target_1, v5000, fine, tool0;",
]
STATEMENTS += ["J P[1] 100% FINE ;", "movej([0,0,0,0,0,0])", "INT k", "$OV_PRO=100"]
HOSTILE_TEXT = st.sampled_from(
    [*"\r\n\v\f\x1c\x85\u2028\u2029\0\x1b\"'`;!#%&{}[]()*/\\:=@$", *STATEMENTS]
)
NOTES = st.lists(
    st.lists(HOSTILE_TEXT | st.text(max_size=9), max_size=9).map("".join), max_size=5
)
# Remarks as the controller's own parser recognises them. KRL: from ; to the end of the
# line; RAPID: from !; URScript: from #; TP: an instruction that begins with !. A
# carriage return ends a line, too.
REMARK = {
    "krl": r";[^\r\n]*",
    "rapid": r"![^\r\n]*",
    "urscript": r"#[^\r\n]*",
    "tp": r"(?m)^ *\d+: *![^;\r\n]*;",
}
# Joint angles of a target in the four languages.
TARGETS = re.compile(r"PTP (\{.*)|:= (\[.*)|movej\((\[.*\]),|GP1:([^}]*)")
STATEMENT_ENDS = re.compile(r"[\r\n\v\f\x1c-\x1e\x85\u2028\u2029;]+")


def list_statements(language, text):
    """Return the statements of a program without remarks and line numbers."""
    without_remarks = re.sub(REMARK[language], "", text)
    statements = [
        re.sub(r"^ *\d+:", "", statement).strip()
        for statement in STATEMENT_ENDS.split(without_remarks)
    ]
    return [statement for statement in statements if statement]


def parse_target(match):
    """Return the first six numbers of a match of `TARGETS`."""
    numbers = re.findall(r"(?<![\w.])-?\d+\.\d+", "".join(match))
    return [float(number) for number in numbers][:6]


@pytest.mark.parametrize("language", CONTROLLERS)
@given(NOTES)
def test_no_text_adds_a_statement_to_a_program_or_changes_its_targets(language, notes):
    module = CONTROLLERS[language]
    targets = make_targets(module)
    text = module.program("go", targets, notes)
    assert list_statements(language, text) == list_statements(
        language, module.program("go", targets)
    )
    assert text.isascii()
    assert all(character.isprintable() or character in "\n\t" for character in text)
    np.testing.assert_allclose(
        [parse_target(match) for match in TARGETS.findall(text)],
        np.radians(targets.values) if language == "urscript" else targets.values,
        atol=1e-6,
    )
