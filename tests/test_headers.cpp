// A target needs a source; this one's headers are what counts (CMakeLists.txt).
