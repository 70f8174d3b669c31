"""A plan as C99: pure functions of parameters and inputs, for controllers and for other tools."""
