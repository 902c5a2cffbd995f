import clspeckle
import numpy as np

shape = (240, 320)
depth = np.full(shape, 0.8, np.float32)  # metres: a wall that comes nearer, and slides by 0.2 mm
ideal = np.ones(shape, np.float32)
skin = clspeckle.Material(correlation_time_s=0.02, degree_of_polarization=0.3)
ids = np.zeros(shape, np.uint8)
ids[:, 160:] = 1  # the right half is skin, which lives

camera = clspeckle.Pipeline.from_parameters(
    shape, seed=7, motion={"intrinsics": (280, 280, 159.5, 119.5)}, materials=[clspeckle.Material(), skin]
)
first = camera.render(ideal, material=ids)
step = np.eye(4)[:3]
step[0, 3] = -2e-4  # where a point was in the frame before, seen from where it is
moved = clspeckle.MotionInput(depth=depth, material=ids, previous_from_current=[step, step], frame_time_s=1 / 30)
second = camera.render(ideal, material=ids, motion=moved)
for name, half in (("wall", np.s_[:, :160]), ("skin", np.s_[:, 160:])):
    print(name, "keeps", np.corrcoef(first[half].ravel(), second[half].ravel())[0, 1].round(2))
