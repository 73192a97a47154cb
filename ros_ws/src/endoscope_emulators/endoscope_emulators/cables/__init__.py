"""Cables between a driver and an emulated device, whose faults a test chooses."""
