"""Where a robot is: an extended Kalman filter over wheel readings and sightings of landmarks.

It knows nothing of pictures, files of runs or the GPU; numbers go in and an estimate comes out.
"""
