"""Motion under loads: quadratures, integrators, events, and the reduced system they solve."""
