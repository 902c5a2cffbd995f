# Vega (https://vega.github.io) draws the figures of the HTML report. Its modules become part of the library: a report
# needs no network.
find_path(CLSP_VEGA_DIR NAMES vega-parser.min.js PATHS /usr/share/javascript/vega /usr/local/share/javascript/vega
          DOC "Folder of Vega's modules as Debian's package libjs-vega installs them (vega-util.min.js and others)")
if(NOT CLSP_VEGA_DIR)
    message(FATAL_ERROR "Vega, which draws the HTML report, was not found. Install Debian's package libjs-vega "
                        "(apt-get install libjs-vega), or set CLSP_VEGA_DIR to the folder with vega-parser.min.js.")
endif()

# Without geographic projections, force layouts, word clouds and the like. A module stands behind those that it needs.
set(clsp_vega_modules
    vega-util vega-time vega-format vega-loader vega-dataflow vega-statistics vega-transforms vega-canvas vega-scale
    vega-scenegraph vega-view-transforms vega-encode vega-expression vega-selection vega-functions vega-runtime
    vega-view vega-event-selector vega-parser vega-interpreter)
set(clsp_vega_files)
foreach(module IN LISTS clsp_vega_modules)
    if(NOT EXISTS "${CLSP_VEGA_DIR}/${module}.min.js")
        message(FATAL_ERROR "${CLSP_VEGA_DIR} holds no ${module}.min.js; install Debian's package libjs-vega (version "
                            "5.22 or later), or set CLSP_VEGA_DIR to the folder of all of Vega's modules.")
    endif()
    list(APPEND clsp_vega_files "${CLSP_VEGA_DIR}/${module}.min.js")
endforeach()

set(clsp_vega_source "${CMAKE_CURRENT_BINARY_DIR}/embedded_vega.cpp")
add_custom_command(
    OUTPUT "${clsp_vega_source}"
    COMMAND "${CMAKE_COMMAND}" "-DOUTPUT=${clsp_vega_source}" "-DFILES=${clsp_vega_files}"
            -P "${PROJECT_SOURCE_DIR}/cmake/EmbedScripts.cmake"
    DEPENDS ${clsp_vega_files} "${PROJECT_SOURCE_DIR}/cmake/EmbedScripts.cmake"
    COMMENT "Embedding Vega" VERBATIM)

target_sources(clsp_diagnosis PRIVATE "${clsp_vega_source}")
target_link_libraries(clsp_diagnosis PRIVATE PkgConfig::SPNG)
