"""Public measurements of real robots to campaigns, one module for each format.

A module has `write_campaign(source, folder, name)`; it imports `elastocal.campaigns`.
"""
