// The same consumer in C++, with the header-only binding; the checksum must be the same.
#include <clspeckle/clspeckle.hpp>

#include <cstdio>

int main() {
    constexpr std::uint32_t side = 32;
    const clspeckle::Context context;
    const clspeckle::Queue queue(context);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = phase_desc.height = aperture_desc.width = aperture_desc.height = side;
    sensor_desc.width = sensor_desc.height = side;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sensor_desc));
    const clspeckle::Buffer input(context, queue, std::vector<float>(side * side, 1.0f));
    const clspeckle::Buffer output(context, side * side * sizeof(std::uint16_t));
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = input.image(side, side, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(side, side, CLSP_FORMAT_UINT16);
    pipeline.enqueue_frame(queue, frame);
    unsigned long sum = 0;
    for (const std::uint16_t code : output.read<std::uint16_t>(queue, side * side))
        sum = (sum * 31 + code) % 1000000007ul;
    std::printf("checksum %lu\n", sum);
}
