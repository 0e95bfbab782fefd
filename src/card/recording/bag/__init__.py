"""Recordings delivered as rosbag2 (sqlite3 or MCAP): reading into the raw layout, and writing."""
