"""What people have, to our files and back: URDF, Denavit-Hartenberg tables,
measurements in any CSV dialect.

Imports `campaigns`, `mechanics` and `io`.
"""
