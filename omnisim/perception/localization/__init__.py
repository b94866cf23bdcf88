"""Localization: an extended Kalman filter over wheel odometry and observations of landmarks.

The filter knows nothing of images or the GPU; numbers go in and an estimate comes out.
"""
