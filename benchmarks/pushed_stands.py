"""How often a diagnosis states a wrong cause if a stand with sockets slips while a ball on
the robot sits in it.

A simulated UR10 with errors of its geometry, which the campaign declares, holds a ball in
two sockets of a tool that stands at three places in turn. In each three cases the first
has stands that do not move and no effect, the second one stand that slips, and the third
such a stand and a clear effect at a joint that is drawn. `python
benchmarks/pushed_stands.py CASES SEED` prints the rates with 95 % intervals (Clopper and
Pearson, 1934), some five seconds a case.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROBOTS
from instruments import (
    EFFECTS,
    MIDDLE_RAD,
    NOISE_M,
    PLACES_RAD,
    Measured,
    draw_defect,
    open_workshop,
    write_measured,
)
from rates import format_rate, make_parser

from elastocal.loop.whole import diagnose_folder
from elastocal_proof.plant.contacts import seat_in_socket

ROWS_A_SOCKET = 20
# The second socket of the printed tool, from the first one.
SOCKET_M = np.array([0.0, 0.05, 0.0])
# A stand on a table slips now and then, by half a millimetre across (RMS of each
# coordinate); a Panda's stand did so by up to two.
SLIP_PROBABILITY = 0.1
SLIP_M = np.array([5e-4, 5e-4, 0.0])
# Effects that are clear beside the slips, of `EFFECTS`.
CLEAR = (
    "harmonics of 0.8 mrad (large)",
    "ratio wrong by 1.5e-3",
    "runout of 0.3 mm and 2 mrad (large)",
    "link weight",
)
# Effects of the set-up. A shift between two rows is one slip of the stand.
SETUP = {"stand_creep", "setup_step"}
# What is true of the three cases: whether a stand slips, and whether an effect acts.
KINDS = (("still", False, False), ("slips", True, False), ("slips, effect", True, True))


@dataclass(frozen=True)
class Outcome:
    """What a diagnosis states of one robot, by the names of the effects."""

    true_effect: str | None
    names: frozenset

    @property
    def states_slip(self):
        """Whether the slipping stand is stated."""
        return "stand_creep" in self.names

    @property
    def states_effect(self):
        """Whether the true effect of the robot is stated."""
        return self.true_effect in self.names

    @property
    def is_wrong(self):
        """Whether an effect of the robot is stated that it does not have."""
        return bool(self.names - SETUP - {self.true_effect})


def measure_places(workshop, slipping, draws):
    """Hold the ball in both sockets at each place; return joint angles (N, n) and the
    place and socket (N,) of each row. The stand at one place slips if it is stated."""
    places = workshop.locate(MIDDLE_RAD + PLACES_RAD)[0]
    angles, sessions, sockets = [], [], []
    for number, place in enumerate(places):
        shift = np.zeros(3)
        for socket in range(2):
            for _ in range(ROWS_A_SOCKET):
                if number == slipping and draws.random() < SLIP_PROBABILITY:
                    shift = shift + SLIP_M * draws.standard_normal(3)
                seat = place + shift + socket * SOCKET_M
                angles.append(seat_in_socket(workshop, seat, NOISE_M["point"]))
                sessions.append(number)
                sockets.append(socket)
    return np.array(angles), sessions, sockets


def diagnose_case(seed, *, slips, effect):
    """Simulate and diagnose one robot, with an effect if it is stated."""
    draws = np.random.default_rng([seed, 4])
    defects = [draw_defect(effect, seed)] if effect else []
    slipping = int(draws.integers(len(PLACES_RAD))) if slips else None
    workshop = open_workshop(seed, defects)
    angles, sessions, sockets = measure_places(workshop, slipping, draws)
    columns = {"session": sessions, "feature": [f"socket{n}" for n in sockets]}
    document = {
        "frame": "unknown",
        "targets": {"tip": {"point": "6DoF", "offset_m": "unknown"}},
        "features": {"socket0": {}, "socket1": {}},
        "distances": [
            {"between": ["socket0", "socket1"], "distance_m": 0.05, "std_m": 1e-4}
        ],
        "noise": {"position_m": NOISE_M["point"]},
    }
    with TemporaryDirectory() as parent:
        folder = Path(parent) / "pushed"
        write_measured(folder, "point", Measured(angles, columns, document))
        verdict = diagnose_folder(folder, ROBOTS, seed)
    stated = frozenset(effect["name"] for effect in verdict["effects"])
    return Outcome(EFFECTS[effect][0] if effect else None, stated)


def main():
    """Print the rates of the three kinds of cases."""
    arguments = make_parser(__doc__, ()).parse_args()
    outcomes = {name: [] for name, *_ in KINDS}
    for number in range(arguments.cases):
        name, slips, acts = KINDS[number % len(KINDS)]
        seed = arguments.first_seed + number
        effect = CLEAR[number // len(KINDS) % len(CLEAR)] if acts else None
        outcome = diagnose_case(seed, slips=slips, effect=effect)
        outcomes[name].append(outcome)
        if arguments.each:
            print(seed, name, outcome.true_effect, sorted(outcome.names), flush=True)
    for name, group in outcomes.items():
        rates = {
            "slipping stand stated": format_rate(each.states_slip for each in group),
            "true effect stated": format_rate(each.states_effect for each in group),
            "a false effect of the robot": format_rate(each.is_wrong for each in group),
        }
        for words, rate in rates.items():
            print(f"{name}: {words}: {rate}")


if __name__ == "__main__":
    main()
