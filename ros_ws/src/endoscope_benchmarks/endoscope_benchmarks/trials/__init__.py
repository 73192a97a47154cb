"""Whole experiments on the simulated rig, without ROS."""
