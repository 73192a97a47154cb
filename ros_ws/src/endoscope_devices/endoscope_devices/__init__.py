"""Servo, load-cell and tracker protocols, free of ROS."""
