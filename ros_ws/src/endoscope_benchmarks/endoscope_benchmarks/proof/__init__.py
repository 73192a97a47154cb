"""Conceals something in rigs, explains their recordings, and opens what was sealed."""
