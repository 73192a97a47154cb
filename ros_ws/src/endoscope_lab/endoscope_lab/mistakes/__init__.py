"""Recordings in which people took something wrongly, and right ones."""
