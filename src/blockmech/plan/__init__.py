"""What a run is: its program, what can be wanted, its settings."""
