"""Evaluation of depth, completion and odometry on a release."""
