"""Rigs that become different while they are watched."""
