// The same ten frames as examples/c/minimal.c, byte for byte, through the C++ binding.
//
//     minimal [prefix]        writes <prefix>_0.pgm to <prefix>_9.pgm, by default speckle_0.pgm to speckle_9.pgm
#include <clspeckle/clspeckle.hpp>

#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t width = 320, height = 240, bits = 10;

// Dots of 1.5 pixels standard deviation, 16 pixels apart, every other row shifted by half of that.
std::vector<float> draw_dots() {
    std::vector<float> image(width * height);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::uint32_t shift = (y / 16) % 2 ? 8 : 0;
            const double dx = static_cast<double>((x + shift) % 16) - 7.5, dy = static_cast<double>(y % 16) - 7.5;
            image[y * width + x] = static_cast<float>(std::exp(-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5)));
        }
    }
    return image;
}

// Written under a temporary name and renamed: whoever watches the folder never sees half a file.
void write_pgm(const std::string &path, const std::vector<std::uint16_t> &codes) {
    const std::string temporary = path + ".part";
    std::ofstream file(temporary, std::ios::binary);
    file << "P5\n" << width << ' ' << height << '\n' << (1u << bits) - 1 << '\n';
    for (std::uint16_t code : codes) // PGM is big-endian
        file.put(static_cast<char>(code >> 8)).put(static_cast<char>(code & 0xff));
    file.close();
    if (!file) {
        std::remove(temporary.c_str());
        throw std::runtime_error("cannot write " + path);
    }
    std::filesystem::rename(temporary, path);
}

void run(const std::string &prefix) {
    // A device and the memory on it.
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    const clspeckle::Buffer irradiance(context, queue, draw_dots());
    const clspeckle::Buffer output(context, sizeof(std::uint16_t) * width * height);

    // The camera: a partly polarized surface, an f/5.6 lens before 2.9 um pixels at 940 nm, a 10-bit sensor.
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = aperture_desc.width = sensor_desc.width = width;
    phase_desc.height = aperture_desc.height = sensor_desc.height = height;
    phase_desc.seed = sensor_desc.seed = 2024;
    aperture_desc.degree_of_polarization = 0.5;
    aperture_desc.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
    sensor_desc.bits = bits;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sensor_desc));

    // Ten frames of a scene at rest: the speckle stays, the noise is new each time.
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = irradiance.image(width, height, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(width, height, CLSP_FORMAT_UINT16);
    for (frame.frame_index = 0; frame.frame_index < 10; ++frame.frame_index) {
        pipeline.enqueue_frame(queue, frame);
        write_pgm(prefix + '_' + std::to_string(frame.frame_index) + ".pgm",
                  output.read<std::uint16_t>(queue, width * height));
    }
    pipeline.check(queue);
}

} // namespace

int main(int argc, char **argv) {
    const std::string prefix = argc > 1 ? argv[1] : "speckle";
    try {
        run(prefix);
    } catch (const clspeckle::Error &error) {
        std::fprintf(stderr, "%s\n%s", error.what(), error.build_log().c_str());
        return 1;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    std::printf("wrote %s_0.pgm to %s_9.pgm\n", prefix.c_str(), prefix.c_str());
}
