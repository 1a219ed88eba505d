"""Public measurements of real robots to campaigns, one module for each format.

An importer has FILES, ROBOTS and `write_campaign`, see `catalogue.Importer`; a new module is a new one. The modules without
FILES are what importers share.
"""
