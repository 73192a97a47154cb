"""Numbers by which explanations are judged, derived from cases whose truth is known.

Made by `endoscope bench concealed --derive` from 207 cases, seeds 421 to 444 of catalogue,
leave_a_form_out, other_sheath, nulls, mixed_forms, sinusoid, teleoperation, pairs, other_simulator.
"""

BEYOND_FORM = 1
"""What is left over what the worst rig of another form leaves, of the worst channel: one, or what
95% of right explanations stay below."""
INTERVAL_WIDTH = 1.23
"""Factor on intervals that makes them hold 90% of the true numbers."""
POSTERIOR = (-1.0, 0.5, 0.5, 0.5, 0.0, -3.0, -3.0, 1.0)
"""Weights of the logarithm of the temperature of evidence: of one, and of the logarithms of the
largest gain, of what form is worth, and of what is left over what another form leaves. Then of the
odds of nothing: of one, and of whether something is said to be missing. Then of those of something
else: of one, and of what is left."""
LEAST_PROBABILITY = (0.1, 0.1)
"""Of what a set holds, where noise alone is left and where more is."""
NAME_OF_FUNCTION = 0.8
"""Chance that a function is a form of the effect whose formula comes nearest at its place."""
