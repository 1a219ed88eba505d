"""What people import: `elastocal` offers the names of these modules.

Each function takes arrays and objects and returns objects. The commands and the workflow
call the same functions below; these modules only put them together in memory.
"""
