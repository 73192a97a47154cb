"""Blind benchmark: rigs with injected effects, their explanations, and how far these are right."""
