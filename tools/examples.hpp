/**
 * @file examples.hpp
 * @brief What stands below the options in the help of each command.
 */
#ifndef CLSPECKLE_TOOLS_EXAMPLES_HPP
#define CLSPECKLE_TOOLS_EXAMPLES_HPP

namespace tools {

inline constexpr const char *exit_codes = R"(Exit codes:
  0  success
  1  wrong usage, configuration or input file
  2  no usable OpenCL device, or the device, the library or the memory failed
  3  a file, a folder or standard output cannot be written
  130  interrupted; finished files stay, half ones are removed)";

inline constexpr const char *main_examples = R"(Examples:
  clspeckle devices
  clspeckle render ideal.png -o out
  clspeckle render examples/office/gbuffers -o out --f-number 8 \
      --exposure-gain auto
  clspeckle statistics out/frame_000000.png --bits 10
  clspeckle effects
  clspeckle diagnose my-camera

Help on a command: clspeckle render --help
)";

inline constexpr const char *render_examples =
    R"(A scene has the channels Z (depth in m) or P.X P.Y P.Z (position in m), and optionally N.X N.Y N.Z (normal), albedo,
visibility, refresh, material (ids) and motion.X motion.Y (where a point was in the frame before, minus where it is, in
pixels). Without INPUT a scene comes from planes: --depth or --position, and --normal, --albedo, --visibility,
--material. Any image may be named as FILE:CHANNEL, by a channel, three with commas, or a layer: --depth
render.exr:ViewLayer.Depth.Z. Without, the channels' names tell which are meant; where several may, they are listed.
Values are linear; integer images are divided by their top code, so 1 is full scale. A scene needs --pattern
IMAGE. Of a folder, what render itself wrote is left out: previews, and the frames of the run whose config.json lies
there; not ideal_*.npy.

Configuration: the options in the groups "Configuration" are also the keys of a JSON file, grouped as here:
  {"aperture": {"f_number": 8},
   "sensor": {"bits": 10, "exposure_gain_dn": "auto"}}
A key is the option's name with underscores, without the name of its group: --pattern-quantity is pattern.quantity (and
--pattern is pattern.image, --sensor is sensor.enabled). --dump-config prints all of them. The command line beats the
configuration file, which beats sequence.json, which beats the defaults.

With --motion the speckle moves and changes with the surfaces: by the poses of the moving_objects in sequence.json, or
by the motion channels. What surfaces are made of says the list "materials" of sequence.json or of --materials FILE:
  {"materials": [{"id": 1, "name": "paper", "roughness_rms_m": 5e-6,
                  "degree_of_polarization": 0}]}
with the members of ClspMaterial (material.h); "living": true means a correlation_time_s of 0.

Effects (clspeckle effects lists them) are switched on by --effect, or in the configuration:
  {"effects": {"defocus": {"waves": 0.8}, "glare": {}}}

Written to the output folder: frame_000000.png ... (or frames.npy for a stack), preview_000000.png ..., ideal_000000.npy
... with --save-ideal, and config.json, with which --config repeats the run. 16-bit files hold the codes as they are.

Examples:
  clspeckle render ideal.png -o out --f-number 4 --seed 7
  clspeckle render ideal.npy -o out --sensor-profile OS04A10 \
      --effect defocus:waves=0.8 --effect dsnu
  clspeckle render ideal.npy -o out --frames 100 --format npy-stack \
      --no-preview --stage-times
  clspeckle render 'gbuffers/*.exr' -o out --pattern dots.png \
      --pattern-half-extent-x 0.7 --pattern-half-extent-y 0.48 --fx 560 \
      --fy 560 --cx 319.5 --cy 239.5
  clspeckle render examples/office/gbuffers -o out --exposure-gain auto \
      --save-ideal
  clspeckle render ideal.png --f-number 8 --dump-config > camera.json
  clspeckle render ideal.png -o out --config camera.json
  clspeckle render ideal.npy -o out --profile profile.json \
      --profile-sequence board_moving
)";

inline constexpr const char *statistics_examples =
    R"(Per frame: mean, standard deviation, contrast (their ratio), skewness, least and greatest value, share at the top code
(of --bits, else of the file's integer type) and at 0, and the size of a speckle: full width at half maximum of the
autocovariance along x and y (not with --mask, whose outline would be measured). Values are as stored. Of a folder, the
previews that render wrote are left out.

Examples:
  clspeckle statistics out/frame_*.png --bits 10
  clspeckle statistics out/frames.npy --temporal --region 100,100,64,64
  clspeckle statistics frame.png --histogram 32 --json
)";

inline constexpr const char *effects_examples =
    R"(Lists what makes a camera's picture differ from the ideal one, in the order in which light meets it, with the parameters
of each effect: a weak and a strong value as cameras show them, and the range that is accepted.

Examples:
  clspeckle effects
  clspeckle effects --json
  clspeckle render ideal.png -o out --effect defocus:waves=0.8 \
      --effect shot_noise
)";

inline constexpr const char *capture_examples =
    R"(Examples:
  clspeckle capture init my-camera --pixel-pitch-um 2.9 --f-number 5.6 \
      --wavelength-nm 940
  clspeckle capture make demo --effect defocus:waves=0.8 --seed 7
  clspeckle capture check demo

Help on a command: clspeckle capture make --help
)";

inline constexpr const char *capture_check_examples =
    R"(Reads a capture set and tells what is in it, what it can and cannot tell apart and why, and which effects of the
catalogue can show in it. Wrong sets are refused: the message names file, frame and field.

Examples:
  clspeckle capture check my-camera
  clspeckle capture check my-camera --json summary.json
)";

inline constexpr const char *capture_init_examples =
    R"(Writes a first capture.json from the frames in a folder, to be edited: sequences by the names of files and folders, bits
by the largest code, black level and read noise by dark frames, dots by where their light is. What frames do not tell
gets a usual value and is listed. Names begin with dark, flat, board or dots; those of board and dots say static (or
rest) or moving. A time in a name ("flat_5ms") is the exposure, NAME_mask.png the mask of sequence NAME.

Examples:
  clspeckle capture init my-camera
  clspeckle capture init my-camera --pixel-pitch-um 2.9 --f-number 5.6 \
      --wavelength-nm 940 --force
)";

inline constexpr const char *capture_emva_examples =
    R"(Computes EMVA 1288's numbers of the dark and flat frames, without a simulation: system gain, dark noise, fixed
patterns, linearity, saturation, dark current, each with a 95 % interval, or why it is not known. Of a resting laser
scene it is the gain.

Examples:
  clspeckle capture emva my-camera
  clspeckle capture emva my-camera --json emva.json --xml emva.xml
)";

inline constexpr const char *capture_make_examples =
    R"(Draws a capture set of the simulator: a dark, a flat, and board and dots at rest and in motion. Static sequences have the
same speckle and new noise in each frame, moving ones new speckle too; fixed patterns of the sensor are the same in all.

Examples:
  clspeckle capture make demo
  clspeckle capture make demo --frames 40 \
      --effect shot_noise:dn_per_electron=0.2 --effect prnu --seed 7 --key
  clspeckle capture make bench --sequences dark,flat \
      --flat-level 100,200,400,800
)";

inline constexpr const char *diagnose_examples =
    R"(CAPTURE is the folder of a capture set: what a camera recorded (docs/guide/captures.md). The simulator draws
the same sequences again and again, calibrated to the camera's light levels, black level and read noise. Statistics of
both are compared.

Verdicts:
  none       no gap between camera and simulator at the level
  named      one effect, or the smallest set that is needed, explains the gap
  ambiguous  two or more effects explain it equally well; the advice says which
             capture would tell
  unknown    a significant part of the gap is explained by no effect of the
             catalogue (clspeckle effects)

The exit code is 0 whenever a report was made, whatever it says. The same seed gives the same report. What the numbers
mean: docs/method/diagnosis.md.

Examples:
  clspeckle diagnose my-camera
  clspeckle diagnose my-camera --json report.json --html report.html \
      --without gamma,full_well
  clspeckle diagnose my-camera --hypothesis shading.json
  clspeckle diagnose my-camera --json - --quiet > report.json
)";

inline constexpr const char *gap_examples =
    R"(Examples:
  clspeckle gap compare my-camera my-simulator
  clspeckle gap check --plan small --out check

Help on a command: clspeckle gap compare --help
)";

inline constexpr const char *gap_compare_examples =
    R"(REAL and SIM are the folders of two capture sets (docs/guide/captures.md), the second from any simulator. Sequences
are paired by name, else by scene and motion, brought to the same light, and compared with the statistics of clspeckle
diagnose. Then the catalogue's effects are put on SIM's frames, as far as that can be done with finished frames, to say
which of them would close how much. Verdicts and exit code are those of diagnose. The method: docs/guide/gap-compare.md.

Examples:
  clspeckle gap compare my-camera my-simulator
  clspeckle gap compare my-camera my-simulator --json report.json \
      --html report.html
)";

inline constexpr const char *gap_check_examples =
    R"(How often is the diagnosis right? An independent generator, Python with NumPy and SciPy, draws capture sets with
known gaps; this program diagnoses them without the keys; a scorer counts (docs/results/gap-check.md). A stopped run goes
on where it was. The table, the wrong sets and, with Matplotlib, figures lie in FOLDER/score.

Examples:
  clspeckle gap check --plan small --out check
  clspeckle gap check --plan full --out full --jobs 2
  clspeckle gap check --plan small --out check --command "other-tool --fast"
)";

inline constexpr const char *gap_power_examples =
    R"(How weak an effect is still seen, and named? The generator of `gap check` draws effects at 0.05 to 1 times the
catalogue's weakest strength, for several numbers of frames; this program diagnoses them without the keys. A stopped
run goes on where it was. Table and, with Matplotlib, figure lie in FOLDER (docs/results/gap-check.md).

Examples:
  clspeckle gap power --out power --jobs 2
  clspeckle gap power --out power --frames 8 --frames 32 --effect defocus \
      --effect shot_noise --repeats 10
)";

inline constexpr const char *dataset_examples =
    R"(Training data: each pair has a scene, a camera and effects, drawn from the ranges of a recipe (JSON) by its seed and the
pair's number alone. FOLDER gets WebDataset shards. A stopped run goes on where it was; so does one with a larger --count.
This is `python -m clspeckle.dataset`, of the Python package. Recipe and files: docs/guide/datasets.md.

Examples:
  clspeckle dataset recipe.json --out set --count 10000 --workers 2
  clspeckle dataset recipe.json --out set --count 10 --python .venv/bin/python
)";

inline constexpr const char *tune_examples =
    R"(An aperture's Fourier transforms are made by clFFT or by the library's own engine, in vector lanes or in work-groups.
This measures all of them on a device (lanes not on GPUs), in turn, and keeps medians and choice in the tuning record,
a JSON file that later runs of the program and the library follow (docs/guide/runtime.md). What runs beside it spoils
the measurement. The fastest is chosen, or the device's default where that is not slower by more than the noise.
Ctrl-C stops without writing. CLSPECKLE_FFT overrides the record; CLSPECKLE_TUNING names another one, or is off.

Examples:
  clspeckle tune
  clspeckle tune --device gpu --size 1280x800 --size 640x400 --frames 50
  clspeckle tune --size 1920x1080 --dry-run --json
)";

inline constexpr const char *completion_examples =
    R"(An installed program brings these scripts to where the shells look for them. From a build folder:

Examples:
  source <(clspeckle completion bash)
  source <(clspeckle completion zsh)
  clspeckle completion fish | source
)";

inline constexpr const char *man_examples =
    R"(The page holds the help of all commands. An installed program brings it along: man clspeckle.

Examples:
  clspeckle man | man -l -
  clspeckle man > clspeckle.1
)";

inline constexpr const char *devices_examples =
    R"(Lists the OpenCL devices, best first, says which one is taken and why, why others are refused, and how to install one.

Examples:
  clspeckle devices
  clspeckle devices --device cpu
  CLSPECKLE_DEVICE=0:0 clspeckle render ideal.png -o out
)";

} // namespace tools

#endif // CLSPECKLE_TOOLS_EXAMPLES_HPP
