import clspeckle
import numpy as np

y, x = np.mgrid[6:240:12, 6:320:12]
dots = clspeckle.Dots((240, 320), np.stack([x.ravel(), y.ravel()], axis=1), sigma_px=2)  # an ideal projector
camera = clspeckle.Pipeline.from_parameters((240, 320), dots=dots, seed=7, effects={"defocus": {"waves": 0.8}})
camera.set_effect("ghost_dots", relative_intensity=0.2)
camera.set_effect("shot_noise")  # what is not given lies between weak and strong
codes = camera.render()
camera.clear_effect()  # all off: bit for bit as if there had been none

for effect in clspeckle.effects():
    print(effect.stage, effect.id, [f"{p.name} {p.weak:g} to {p.strong:g} {p.unit}" for p in effect.parameters])
