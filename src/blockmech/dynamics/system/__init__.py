"""What moves: the reduced system of a mechanism, and what its loads depend on."""
