"""Numbers by which explanations are judged."""

LEAST_SHARE = 0.5
SURE, RIVALLED = 3.3, 0.0
BEYOND_FORM = 1.5
REACH = 1.0
