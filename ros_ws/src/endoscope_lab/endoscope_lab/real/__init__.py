"""Real recordings of a flexible endoscope, explained by one physics."""
