"""Results: samples, motions, quality, tables, and why samples have no answer."""
