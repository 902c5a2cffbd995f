#include "depth.hpp"
#include "number_options.hpp"
#include "options.hpp"

#include <fmt/format.h>

namespace tools {

void add_depth(CLI::App &app, DepthArguments &a) {
    app.footer(
        R"(FRAMES show the dots of a laser: images, stacks, folders or glob patterns, all of one size; values as stored. Of each
frame the dots are found with centres to a fraction of a pixel, identified by their neighbourhood along their
epipolar lines, and triangulated (docs/guide/depth.md). Dots without a depth get a reason.

--dots LIST: the directions of the pattern's dots in the laser's frame, two numbers in a line (x/z, y/z), or an NPY array
of two columns, at most 16384 rows. Or the JSON of `clspeckle doe layout` or `doe design`, whose direction cosines are
converted as the projection of the geometry file asks. --geometry FILE: a sequence.json, or a JSON file with these members of it:
  {"camera": {"fx_px": 560, "fy_px": 560, "cx_px": 319.5, "cy_px": 239.5},
   "laser": {"laser_from_geometry": [1,0,0,-0.075, 0,1,0,0, 0,0,1,0],
             "pattern": {"projection": "tangent_plane"}},
   "depth_range_m": [0.4, 4]}
laser_from_geometry is [R|t] by rows from the camera's frame to the laser's; projection and depth_range_m may be left out.

Examples:
  clspeckle depth out/frame_*.png --dots dots.txt --geometry sequence.json \
      --near-m 0.4 --far-m 4
  clspeckle depth out/frames.npy --dots dots.npy --geometry rig.json \
      --read-noise-dn 4 --black-level-dn 64 --csv dots.csv
  clspeckle depth frame.png --dots layout.json --geometry rig.json \
      --pictures pictures --json
)");
    app.add_option("FRAMES", a.files, "Images, stacks, folders or glob patterns")->required()->type_name("");
    const auto text = [&](const char *name, std::string &value, const std::string &what, const char *type) {
        return app.add_option(name, value, what)->type_name(type)->take_last();
    };
    text("--dots", a.dots, "List of the directions of the pattern's dots", "FILE")->required();
    text("--geometry", a.geometry, "JSON with camera and laser, for example sequence.json", "FILE")->required();
    text("--csv", a.csv, "Write all dots of all frames, also those without a depth, as a table", "FILE");
    text("--npy", a.npy, "Write the same as a structured NumPy array", "FILE");
    text("--pictures", a.pictures,
         "Write pictures of each frame into this folder: the dots on the frame with a legend, the depth in colors with "
         "a scale; and the depth as NPY",
         "FOLDER");
    add_number(app, "--near-m", a.near_m, ranges::depth_m, "Least depth (default: the geometry file's, else 0.2)");
    add_number(app, "--far-m", a.far_m, ranges::depth_m, "Largest depth (default: the geometry file's, else 10)");
    add_number(app, "--relative-diameter", a.relative_diameter, ranges::relative_diameter,
               "Pixel pitch / (wavelength * f-number), for what speckle does to centres; 0: without (default: of the "
               "geometry file's lens)");
    const auto number = [&](const char *name, auto &value, const Range &range, const char *what) {
        add_number_with_default(app, name, value, range, what);
    };
    ClspDepthDesc &d = a.desc;
    number("--dot-sigma-px", d.dot_sigma_px, ranges::dot_sigma_px, "Expected width of the dots");
    number("--read-noise-dn", d.read_noise_dn, ranges::noise_dn,
           "Standard deviation of the noise in the dark; 0: unknown");
    number("--dn-per-electron", d.dn_per_electron, ranges::dn_per_electron, "Of the shot noise; 0: none");
    number("--black-level-dn", d.black_level_dn, ranges::level_dn, "Value without light");
    number("--saturation-dn", d.saturation_dn, ranges::noise_dn, "Pixels at or above it are saturated; 0: none is");
    number("--min-amplitude-dn", d.min_amplitude_dn, ranges::noise_dn, "Dots below it are not looked at");
    number("--threshold-sigmas", d.threshold_sigmas, ranges::sigmas, "Of the noise, where it is known");
    number("--min-correlation", d.min_correlation, ranges::part, "With the expected dot, below 1");
    number("--speckle-contrast", d.speckle_contrast, ranges::part, "Of the light; unpolarized: 0.71");
    number("--epipolar-tolerance-px", d.epipolar_tolerance_px, ranges::tolerance_px, "Largest distance from a line");
    number("--min-confidence", d.min_confidence, ranges::confidence, "Least probability of an identity, below 1");
    number("--max-dots", d.max_dots, ranges::detected_dots, "Room for detected dots");
    app.add_flag("--overwrite", a.overwrite, "Replace files that exist");
    text("--channel", a.channel, channel_help(), "TEXT");
    text("--raw", a.raw, raw_help(), "LAYOUT");
    text("--device", a.device, "OpenCL device, as for render", "TEXT");
}

} // namespace tools
