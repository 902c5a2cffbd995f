// What needs OpenEXR, apart from the other formats: the shared library shall not depend on it.
#ifndef CLSPECKLE_IO_OPENEXR_HPP
#define CLSPECKLE_IO_OPENEXR_HPP

namespace image_io {

/** Lets the registry read EXR files; once, before any file is opened. */
void add_openexr();

} // namespace image_io

#endif // CLSPECKLE_IO_OPENEXR_HPP
