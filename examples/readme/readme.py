import clspeckle
import numpy as np

ideal = np.ones((480, 640), np.float32)  # what a renderer made: here a flat, lit wall

camera = clspeckle.Pipeline.from_parameters(ideal.shape, f_number=5.6, seed=7)
for index in range(10):  # same speckle, new noise
    codes = camera.render(ideal, frame_index=index)
print("first codes:", *codes[0, :3])

moved = np.zeros(ideal.shape, np.uint8)
moved[100:200, 300:400] = 1  # new speckle where the scene moved
codes = camera.render(ideal, refresh=moved)
