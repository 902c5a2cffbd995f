import clspeckle
import numpy as np

ideal = np.ones((480, 640), np.float32)  # what a renderer made: here a flat, lit wall
codes = clspeckle.simulate(ideal, f_number=5.6, seed=7)
print("the camera records", codes.mean().round(1), "DN on average")

found = clspeckle.diagnose("my-camera")  # the folder of the second command
print(found.verdict, found.effects)
print("part of the gap gone:", round(found.shrink.fraction, 2))
