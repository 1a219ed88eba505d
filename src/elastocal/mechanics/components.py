"""Components of a displacement and of a wrench: name, unit and meaning, as every table and file has them."""

COMPONENTS = (
    ("dx", "m", "displacement along base x"),
    ("dy", "m", "displacement along base y"),
    ("dz", "m", "displacement along base z"),
    ("rx", "rad", "rotation vector about base x"),
    ("ry", "rad", "rotation vector about base y"),
    ("rz", "rad", "rotation vector about base z"),
)
WRENCH = (
    ("fx", "N", "force along base x"),
    ("fy", "N", "force along base y"),
    ("fz", "N", "force along base z"),
    ("mx", "N m", "moment about base x"),
    ("my", "N m", "moment about base y"),
    ("mz", "N m", "moment about base z"),
)
COMPONENT_NAMES = tuple(name for name, _, _ in COMPONENTS)
WRENCH_NAMES = tuple(name for name, _, _ in WRENCH)
