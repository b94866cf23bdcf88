"""Evaluation of estimators on recorded runs, whose truth is known.

An estimator is an adapter to a method that estimates a robot's trajectory, or calibrates its
camera, from a run's sensors: third-party odometry, SLAM and calibration, or our own. Each runs in
its own process.
"""
