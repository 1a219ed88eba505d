"""The chain notation: its meaning, and one-line errors for every fault."""

import math

import pytest
from support import refused

from elastocal.mechanics.chain import Transform, parse_chain


def test_each_token_becomes_one_transform():
    text = "Tz(l1) Rz(q1) Tx(-l2) Ry(-q2) Rx(90deg) Rx(-30.5deg) Ty(-.25) Tz(2) [EE]"
    chain = parse_chain(text, {"l1": 0.6, "l2": 0.3}, "test")
    assert chain.transforms == (
        Transform("T", 2, 0.6),
        Transform("R", 2, 0.0, 0, 1.0),
        Transform("T", 0, -0.3),
        Transform("R", 1, 0.0, 1, -1.0),
        Transform("R", 0, math.pi / 2),
        Transform("R", 0, -math.radians(30.5)),
        Transform("T", 1, -0.25),
        Transform("T", 2, 2.0),
    )
    assert chain.coordinates == 2
    assert [(p.name, p.after) for p in chain.points] == [("EE", 8)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Tz(l1) Rz(q1) Tw(l2) [A]", ["'Tw(l2)'", "Tx(length)", "[POINT]"]),
        ("Tz(l1)Rz(q1) Tx(l2) [A]", ["'Tz(l1)Rz(q1)'", "separated by blanks"]),
        ("Tz(l1) Rz(q1) Tx(l2 [A]", ["'Tx(l2'"]),
        ("Tz(l1) Rz(q1) Tx(l2) []", ["'[]'"]),
        ("Tz(l1) Rz(q2) Tx(l2) [A]", ["'Rz(q2)'", "q1 or degrees"]),
        ("Tz(l1) Rz(q1) Tx(l2) Ry(-q1) [A]", ["'Ry(-q1)'", "q2 or degrees"]),
        ("Tz(l1) Rz(q1) Tx(l2) Ry(90) [A]", ["'Ry(90)'", "90deg"]),
        ("Tz(l1) Rz(q1) Tx(l9) [A]", ["'Tx(l9)'", "l1, l2 or metres"]),
        ("Tz(l1) Rz(q1) Tx(q3) [A]", ["'Tx(q3)'", "q2 or l1, l2 or metres"]),
        ("Tz(l1) Rz(q1) Tx(1,5) [A]", ["'Tx(1,5)'"]),
        ("Tz(l1) Rz(q1) [A] Tx(l2) [A]", ["[A] twice", "once"]),
        ("Tz(l1) Rz(q1) [A] Tx(l2)", ["'Tx(l2)' at its end", "measuring point"]),
        ("Tz(l1) Rz(q1) Tx(l2)", ["'Tx(l2)' at its end", "[6DoF] at the end"]),
        ("Tz(l1) Tx(l2) [A]", ["no joint", "q1"]),
        ("", ["no joint", "q1"]),
    ],
)
def test_faulty_chain_is_refused_in_one_line(text, words):
    with refused("robots/x.yaml", "chain", *words):
        parse_chain(text, {"l1": 1.0, "l2": 2.0}, "robots/x.yaml")


@pytest.mark.parametrize("name", ["@SUM(A1)", "=1", "-x", "a\u202eb", "a\x1b[b"])
def test_a_point_name_that_a_table_or_a_terminal_would_interpret_is_refused(
    name,
):
    with refused("a.yaml", "chain"):
        parse_chain(f"Rz(q1) Tx(1.0) [{name}]", {}, "a.yaml")


def test_more_joints_than_an_arm_has_are_refused_before_they_fill_the_memory():
    def write_chain(joints):
        numbered = [f"Rz(q{number}) Tx(1)" for number in range(1, joints + 1)]
        return " ".join([*numbered, "[A]"])

    assert parse_chain(write_chain(32), {}, "test").coordinates == 32
    with refused("test", "chain", "33 joints", "32 joints at most"):
        parse_chain(write_chain(33), {}, "test")
