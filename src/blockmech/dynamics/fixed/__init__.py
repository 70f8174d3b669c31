"""Methods of fixed steps: Runge-Kutta in time, and the paper's in the coordinate."""
