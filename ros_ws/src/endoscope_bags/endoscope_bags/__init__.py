"""Reading, writing, checking and recovering rosbag2 MCAP recordings, free of ROS."""
