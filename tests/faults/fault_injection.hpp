// Makes the n-th call of this process's own code fail, once or from then on: an OpenCL call by the driver's dispatch
// table, an allocation by operator new, a file by the C library. What a driver does inside a call never fails.
#pragma once

#include <cstdint>

namespace faults {

enum class Kind { kOpenCl, kAllocation, kFile };

// Puts itself between the ICD loader and the platform's driver. Call once, before anything else.
void install();

// Counts calls of a kind from here on; the n-th (from 1) fails, and those after it if `lasting`. 0: none.
void arm(Kind kind, std::uint64_t n, bool lasting = false);
void disarm();
std::uint64_t calls();  // of the armed kind, since arm()
bool has_failed();      // since arm()
const char *failed();   // which call did

// OpenCL objects that were made or retained and not released, of the process's own.
std::int64_t live_objects();
// Blocks of operator new that are not freed, of the process's own, but for the program's.
std::int64_t live_blocks();

// While one lives, calls of this thread are not the process's own: neither counted nor failed.
struct Aside {
    Aside();
    ~Aside();
    Aside(const Aside &) = delete;
    Aside &operator=(const Aside &) = delete;
};

} // namespace faults
