/**
 * @file dataset.hpp
 * @brief `clspeckle dataset`: pairs of ideal and recorded images, by the Python package.
 */
#ifndef CLSPECKLE_TOOLS_DATASET_HPP
#define CLSPECKLE_TOOLS_DATASET_HPP

#include <cstdint>
#include <string>

namespace tools {

struct DatasetArguments {
    std::string recipe;
    std::string folder;
    std::string python = "python3";
    std::string format = "webdataset";
    std::string devices; // separated by commas; empty: the best
    std::string cluster; // address of a scheduler; empty: none
    std::uint64_t count = 0;
    std::uint32_t shard_size = 1000;
    std::uint32_t workers = 0; // not said: 1, or one for each device
    std::uint32_t threads = 0; // not said: a share of the cores
    bool without_ideal = false;
};

/** Goes on as `python -m clspeckle.dataset`; returns only by an exception. */
[[noreturn]] void run_dataset(const DatasetArguments &arguments, bool quiet);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DATASET_HPP
