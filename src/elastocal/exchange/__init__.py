"""What people have, to our files and back: URDF, Denavit-Hartenberg tables, measurements in any CSV dialect.

Imports `campaigns`, `mechanics` and `io`.
"""

# How well masses are known, as a standard deviation over the value. A URDF does not say where they come from: of a drawing
# without cables, grease and covers, or guessed; where dynamic parameters of robots were identified, masses and centres of such
# models were off by a tenth to a third.
URDF_MASS_STD = 0.2
