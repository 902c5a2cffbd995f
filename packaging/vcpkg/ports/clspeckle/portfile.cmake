# An overlay port of this checkout: vcpkg install clspeckle --overlay-ports=packaging/vcpkg/ports
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../../.." ABSOLUTE)

# The figures of the HTML report. vcpkg has no Vega: Debian's package of its files.
vcpkg_download_distfile(VEGA
    URLS "https://deb.debian.org/debian/pool/main/v/vega.js/libjs-vega_5.22.1+ds+~3.1.0-4_all.deb"
    FILENAME "libjs-vega_5.22.1+ds+~3.1.0-4_all.deb"
    SHA512 a8f6198301cbde799be8f2f7d22eed20f246843b46a0db332d66aea204a117b29b1e2a52ba8e44eea6d75844636bbe6b9fc13928b096d516cf5d1c59fd50710e
)
set(VEGA_PATH "${CURRENT_BUILDTREES_DIR}/vega")
file(ARCHIVE_EXTRACT INPUT "${VEGA}" DESTINATION "${VEGA_PATH}")
file(ARCHIVE_EXTRACT INPUT "${VEGA_PATH}/data.tar.xz" DESTINATION "${VEGA_PATH}")

# Debian, and so the library, has stb's headers in a folder of that name.
set(STB_PATH "${CURRENT_BUILDTREES_DIR}/stb")
file(GLOB STB_HEADERS "${CURRENT_INSTALLED_DIR}/include/stb_*.h")
file(COPY ${STB_HEADERS} DESTINATION "${STB_PATH}/stb")

vcpkg_cmake_configure(
    SOURCE_PATH "${SOURCE_PATH}"
    OPTIONS
        -DCLSP_BUILD_TOOLS=OFF
        -DCLSP_BUILD_EXAMPLES=OFF
        -DCLSP_BUILD_TESTS=OFF
        -DCLSP_BUILD_BENCH=OFF
        "-DCLSP_VEGA_DIR=${VEGA_PATH}/usr/share/javascript/vega"
        "-DCLSP_STB_INCLUDE_DIR=${STB_PATH}"
)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH "lib/cmake/clspeckle")
vcpkg_fixup_pkgconfig()
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
