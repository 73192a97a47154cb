"""Force at the tip: rigs that touch an obstacle in teleoperation, and what is worked out of it."""
