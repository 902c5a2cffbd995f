# Writes OUTPUT, a C++ file with the array NAMEs of TYPE (declared in HEADER) that holds each of FILES as a raw string,
# and their number as NAMECount; each goes by its path below FOLDER. Run with cmake -P.
set(text "// Made by cmake/EmbedTexts.cmake.\n#include \"${HEADER}\"\n\n")
string(APPEND text "namespace clsp {\n\nconst ${TYPE} ${NAME}s[] = {\n")
list(LENGTH FILES count)
foreach(file IN LISTS FILES)
    file(RELATIVE_PATH name "${FOLDER}" "${file}")
    file(READ "${file}" content)
    # A literal may not exceed 64 KiB on some compilers, and may not hold its own end mark.
    string(LENGTH "${content}" length)
    string(FIND "${content}" ")CLSP\"" mark)
    if(length GREATER 60000 OR NOT mark EQUAL -1)
        message(FATAL_ERROR "${name} cannot be embedded as one string")
    endif()
    string(APPEND text "    {\"${name}\", R\"CLSP(${content})CLSP\"},\n")
endforeach()
string(APPEND text "};\nconst std::size_t ${NAME}Count = ${count};\n\n} // namespace clsp\n")
file(WRITE "${OUTPUT}.tmp" "${text}")
file(RENAME "${OUTPUT}.tmp" "${OUTPUT}")
