"""Conan 2: builds the library of this checkout with the system's packages, on Debian and Ubuntu.

conan create packaging/conan --build=missing     (-c tools.system.package_manager:mode=install installs what is missing)

Conan's own index has no clFFT, so the system's packages are used for all that the library is linked with.
"""

import os
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load
from conan.tools.system.package_manager import Apt

# What the library is built of.
SOURCES = ("bindings/cpp", "capi", "cmake", "core", "diagnosis", "io", "kernels", "tuning")


class ClspeckleConan(ConanFile):
    name = "clspeckle"
    description = "Real-time statistical simulation of laser speckle for depth cameras"
    license = "MIT"
    author = "The clSpeckle authors"
    topics = ("speckle", "laser", "depth camera", "OpenCL", "simulation")
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"shared": [True, False]}  # noqa: RUF012
    default_options = {"shared": True}  # noqa: RUF012

    @property
    def _root(self):
        return os.path.join(self.recipe_folder, "..", "..")

    def set_version(self):
        text = load(self, os.path.join(self._root, "capi", "include", "clspeckle", "types.h"))
        self.version = ".".join(re.findall(r"#define CLSP_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", text))

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE", *(f"{folder}/*" for folder in SOURCES)):
            copy(self, pattern, self._root, self.export_sources_folder)

    def system_requirements(self):
        Apt(self).install(
            [
                "ocl-icd-opencl-dev",
                "opencl-headers",
                "opencl-clhpp-headers",
                "libclfft-dev",
                "libfmt-dev",
                "libeigen3-dev",
                "nlohmann-json3-dev",
                "libjs-vega",
                "libspng-dev",
                "libtiff-dev",
                "libjpeg62-turbo-dev",
                "libstb-dev",
                "pkg-config",
            ],
            check=True,
        )

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        for part in ("TOOLS", "EXAMPLES", "TESTS", "BENCH"):
            toolchain.cache_variables[f"CLSP_BUILD_{part}"] = False
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))

    def package_info(self):
        # The library's own CMake package and pkg-config file know what a static one is linked with.
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = [os.path.join("lib", "cmake", "clspeckle")]
        self.cpp_info.libs = ["clspeckle"]
