# cmake -DCC=... -DCXX=... -DINCLUDE=<dir;dir> -DHEADERS=<dir> -DCPP_HEADERS=<dir> -P check_headers.cmake
# Every public header compiles alone, strictly, as C99 and C++17; the C++ binding as C++17.
set(strict -Wall -Wextra -Wpedantic -Werror -fsyntax-only)
list(TRANSFORM INCLUDE PREPEND "-I" OUTPUT_VARIABLE include_flags)
set(checked 0)

function(check compiler header)
    execute_process(COMMAND "${compiler}" ${ARGN} ${strict} ${include_flags} -include "${header}" /dev/null
                    RESULT_VARIABLE result ERROR_VARIABLE errors OUTPUT_VARIABLE errors)
    if(NOT result EQUAL 0)
        message(FATAL_ERROR "${header} does not compile with ${ARGN}:\n${errors}")
    endif()
endfunction()

file(GLOB headers "${HEADERS}/clspeckle/*.h")
foreach(header IN LISTS headers)
    check("${CC}" "${header}" -x c -std=c99)
    check("${CXX}" "${header}" -x c++ -std=c++17)
    math(EXPR checked "${checked} + 1")
endforeach()
file(GLOB cpp_headers "${CPP_HEADERS}/clspeckle/*.hpp")
foreach(header IN LISTS cpp_headers)
    check("${CXX}" "${header}" -x c++ -std=c++17)
    math(EXPR checked "${checked} + 1")
endforeach()
if(checked LESS 10)
    message(FATAL_ERROR "only ${checked} headers were found")
endif()
message(STATUS "${checked} headers compile alone")
