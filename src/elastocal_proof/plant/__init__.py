"""A physical robot to be blind about: MuJoCo statics with defects, its tracker, its
load cell, and the campaigns made with it.

Of elastocal only `errors` is imported, and the laws of the defects are on purpose not
those of the catalogue, so that an agreement of the two is a finding and not the same
line of code run twice.
"""
