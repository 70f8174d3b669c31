"""A mechanism as a functional mock-up unit (FMI 2.0), built on the C text of its plan."""
