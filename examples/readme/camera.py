import clspeckle
import numpy as np

shape = (480, 640)
camera = clspeckle.Pipeline.from_parameters(
    shape,
    seed=7,
    f_number=2.8,  # the lens: six blades, a little out of focus, some coma
    oversampling=2,
    blade_count=6,
    defocus_waves=0.3,
    zernike_waves={7: 0.05},
    k1=-0.05,
    vignetting_corner_loss=0.3,
    glare_fraction=0.05,
    ambient=0.02,
    photons_per_unit=4000,  # the sensor, in electrons: shot noise, unequal pixels, fixed patterns, lag
    quantum_efficiency=0.4,
    conversion_gain_dn_per_e=0.25,
    full_well_e=3600,
    shot_noise=True,
    prnu=0.01,
    dsnu_dn=1.5,
    column_offset_dn=0.8,
    lag_fraction=0.02,
    line_count=5,  # the laser and the air
    dephasing_rad=0.5,
    power_flicker=0.02,
    airflow_rms_rad=0.3,
)
frames = [camera.render(np.ones(shape, np.float32)) for _ in range(3)]
lamp = camera.render(np.ones(shape, np.float32), illumination="incoherent")
dark = camera.render(illumination="dark")
print("means:", *(round(float(frame.mean())) for frame in (*frames, lamp, dark)))
