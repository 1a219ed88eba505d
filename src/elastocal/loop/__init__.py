"""Closing the loop on a campaign: from its folder to the verdict, and the tables in
between. The science is below.

Imports `diagnosis` and what that imports.
"""
