"""How well the masses of an imported robot are known where nothing says it: standard deviation over the value."""

# A URDF does not say where its masses come from: of a drawing without cables, grease and covers, or guessed. Where dynamic
# parameters of robots were identified, masses and centres of such models were off by a tenth to a third.
OF_URDF = 0.2
# A table with masses is a maker's or was identified; a tenth is what such masses are known to at best.
OF_TABLE = 0.1
