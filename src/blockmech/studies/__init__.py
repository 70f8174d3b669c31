"""Studies: what becomes of a mechanism when its numbers are turned, design by design."""
