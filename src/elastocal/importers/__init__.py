"""Public measured data as campaign folders, one module for each source. See `public_data` for where the files are."""
