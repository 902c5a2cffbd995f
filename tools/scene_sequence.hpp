/**
 * @file scene_sequence.hpp
 * @brief Scene descriptions: what a sequence.json says of its files, materials and moving objects.
 */
#ifndef CLSPECKLE_TOOLS_SCENE_SEQUENCE_HPP
#define CLSPECKLE_TOOLS_SCENE_SEQUENCE_HPP

#include "options.hpp"

#include <clspeckle/clspeckle.hpp>

#include <string>
#include <vector>

namespace tools {

/** An object that moves as a whole. */
struct MovingObject {
    std::vector<std::size_t> materials;
    std::vector<std::vector<double>> geometry_from_object; ///< [R|t] in each frame.
};

/** What a sequence.json says beside the configuration. */
struct SceneSequence {
    std::vector<std::string> files;
    std::vector<ClspMaterial> materials;
    std::vector<MovingObject> objects;
    bool is_sequence = false;
};

/** The table of a file that names materials alone; ids that it does not name are of the defaults. */
std::vector<ClspMaterial> read_materials(const std::string &path);

/** Takes over what a sequence.json says. */
SceneSequence read_sequence(const std::string &path, Config &config);

} // namespace tools

#endif // CLSPECKLE_TOOLS_SCENE_SEQUENCE_HPP
