"""Geometry, beyond its closed forms: an eccentric nest."""

from support import chain_of
from synthetic import candidate_on

from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.sites import sites_of


def test_nest_is_no_candidate_where_the_last_joint_does_not_turn():
    """A reflector that a slide carries keeps its side to the tracker: there is no angle that it could circle with."""
    scara = chain_of("Tz(0.4) Rz(q1) Tx(0.4) Rz(q2) Tx(0.3) Tz(-q3) [end]")
    assert not any(c.effect == "nest_eccentricity" for c in candidates_on(sites_of(scara)).values())
    turning = chain_of("Tz(0.4) Rz(q1) Tx(0.4) Tz(-q2) Tx(0.3) Rz(q3) [end]")
    assert {p.name[4] for p in candidate_on(turning, "nest_eccentricity").parameters} == {"x", "y"}
