"""Components of a displacement and of a wrench: the name, unit and meaning that all
tables and files use."""

COMPONENTS = (
    *((f"d{axis}", "m", f"displacement along base {axis}") for axis in "xyz"),
    *((f"r{axis}", "rad", f"rotation vector about base {axis}") for axis in "xyz"),
)
COMPONENT_NAMES = tuple(name for name, _, _ in COMPONENTS)
WRENCH_NAMES = ("fx", "fy", "fz", "mx", "my", "mz")
