# Writes OUTPUT, a C++ file that holds each of FILES (JavaScript) as a raw string named after the file. Run
# with cmake -P.
set(text "// Made from the files of Debian's package libjs-vega by cmake/EmbedScripts.cmake.\n")
string(APPEND text
    "#include \"report/report_script.hpp\"\n\nnamespace clsp {\n\nconst EmbeddedScript kVegaModules[] = {\n")
list(LENGTH FILES count)
foreach(file IN LISTS FILES)
    get_filename_component(name "${file}" NAME)
    string(REPLACE ".min.js" "" name "${name}")
    file(READ "${file}" content)
    # The reader would look for the map in the folder of the page.
    string(REGEX REPLACE "//# sourceMappingURL=[^\n]*" "" content "${content}")
    string(FIND "${content}" ")CLSPJS\"" mark)
    string(FIND "${content}" "</script" end)
    if(content STREQUAL "" OR NOT mark EQUAL -1 OR NOT end EQUAL -1)
        message(FATAL_ERROR "${file} cannot be embedded in a page")
    endif()
    string(APPEND text "    {\"${name}\", R\"CLSPJS(${content})CLSPJS\"},\n")
endforeach()
string(APPEND text "};\nconst std::size_t kVegaModuleCount = ${count};\n\n} // namespace clsp\n")
file(WRITE "${OUTPUT}.tmp" "${text}")
file(RENAME "${OUTPUT}.tmp" "${OUTPUT}")
