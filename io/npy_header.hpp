// The header of NPY files, for arrays that are no images, too.
#ifndef CLSPECKLE_IO_NPY_HEADER_HPP
#define CLSPECKLE_IO_NPY_HEADER_HPP

#include <cstdint>
#include <string>
#include <vector>

namespace image_io {

/** @param descr as Python spells it: "'<f4'", or a list of named fields. */
std::string npy_header(const std::string &descr, const std::vector<std::uint64_t> &shape);

} // namespace image_io

#endif // CLSPECKLE_IO_NPY_HEADER_HPP
