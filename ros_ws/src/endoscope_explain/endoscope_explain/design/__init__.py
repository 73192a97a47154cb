"""The motion that would tell rival explanations apart."""
