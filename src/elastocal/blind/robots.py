"""The robots of the blind proof: those on which it is proved, and the one on which the method was tuned."""

PROVED_ON, TUNED_ON = ("fanuc", "abb"), ("kuka",)
PROOF, TUNED = "proof", "tuned"


def kind_of(robot):
    """Whether a robot belongs to the proof or was tuned on."""
    return TUNED if robot in TUNED_ON else PROOF


def leading(kinds):
    """Which kind of robots a figure shows: those of the proof, or where there is none the one that was tuned on."""
    return PROOF if PROOF in set(kinds) else TUNED
