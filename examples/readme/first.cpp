#include <clspeckle/clspeckle.hpp>
#include <iostream>

int main() {
    const std::vector<float> ideal(480 * 640, 1.0f); // what a renderer made: here a flat, lit wall
    const std::vector<std::uint16_t> codes = clspeckle::simulate(ideal, 640, 480, 7);
    std::cout << "first codes: " << codes[0] << ' ' << codes[1] << ' ' << codes[2] << '\n';
}
