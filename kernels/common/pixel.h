// The pixel of an image whose format the build names: IMAGE_FORMAT.
#ifndef CLSP_PIXEL_H
#define CLSP_PIXEL_H

#include "common/common.h"

#if IMAGE_FORMAT == FORMAT_UINT8
typedef uchar pixel_t;
#elif IMAGE_FORMAT == FORMAT_UINT16
typedef ushort pixel_t;
#else
typedef float pixel_t;
#endif

#endif
