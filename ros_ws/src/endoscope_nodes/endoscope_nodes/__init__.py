"""The rclpy nodes of the master-slave endoscope."""
