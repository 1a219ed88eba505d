"""Whatever a robot, a campaign or a tool is called, a program has the statements of its
targets and no other."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_targets import make_targets

from elastocal.exchange.controllers import CONTROLLERS

WORDS = [
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
WORDS += ["J P[1] 100% FINE ;", "movej([0,0,0,0,0,0])", "INT k", "$OV_PRO=100"]
EVIL = st.sampled_from(
    [*"\r\n\v\f\x1c\x85\u2028\u2029\0\x1b\"'`;!#%&{}[]()*/\\:=@$", *WORDS]
)
NOTES = st.lists(
    st.lists(EVIL | st.text(max_size=9), max_size=9).map("".join), max_size=5
)
# What a controller's own parser takes for a remark: KRL from ; and RAPID from ! to the
# end of the line, URScript from #, TP an instruction that begins with !. All end a line
# at a carriage return as well.
REMARK = {
    "krl": r";[^\r\n]*",
    "rapid": r"![^\r\n]*",
    "urscript": r"#[^\r\n]*",
    "tp": r"(?m)^ *\d+: *![^;\r\n]*;",
}
ENDS = re.compile(r"[\r\n\v\f\x1c-\x1e\x85\u2028\u2029;]+")


def statements(language, text):
    """Without remarks and the numbers of lines."""
    kept = (
        re.sub(r"^ *\d+:", "", part).strip()
        for part in ENDS.split(re.sub(REMARK[language], "", text))
    )
    return [part for part in kept if part]


@pytest.mark.parametrize("language", CONTROLLERS)
@given(NOTES)
def test_no_text_adds_a_statement_to_a_program_and_the_targets_come_back(
    language, notes
):
    module = CONTROLLERS[language]
    targets = make_targets(module)
    text = module.program("go", targets, notes)
    assert statements(language, text) == statements(
        language, module.program("go", targets)
    )
    assert text.isascii() and all(
        character.isprintable() or character in "\n\t" for character in text
    )
    # Where the targets themselves stand.
    lines = re.findall(r"PTP (\{.*)|:= (\[.*)|movej\((\[.*\]),|GP1:([^}]*)", text)
    numbers = [
        [float(n) for n in re.findall(r"(?<![\w.])-?\d+\.\d+", "".join(found))][:6]
        for found in lines
    ]
    np.testing.assert_allclose(
        numbers,
        np.radians(targets.values) if language == "urscript" else targets.values,
        atol=1e-6,
    )
