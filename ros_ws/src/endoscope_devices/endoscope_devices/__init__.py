"""Servo, load-cell and tracker protocols with their emulators, free of ROS."""
