// cl_images (2D image objects) copied into images in buffers and back.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/image_view.hpp"

#include <cstdint>

namespace clsp {

// Which values go where is told in interop.h of the C API. Both check everything before the first command.
void enqueue_cl_image_import(Context &context, CommandChain &chain, cl_mem cl_image, std::uint32_t first_channel,
                             const ImageDescription &image);
void enqueue_cl_image_export(Context &context, CommandChain &chain, const ImageDescription &image, cl_mem cl_image);

} // namespace clsp
