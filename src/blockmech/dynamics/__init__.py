"""Forward dynamics: motion under loads, by the path method and the time method."""
