# SPDX-License-Identifier: Apache-2.0
# Run by cmake -P: writes OUTPUT, a C++ table of every .cl and .h file below DIRECTORY, by path.
# String literals stay below 16 kB, the shortest maximum among compilers.

file(GLOB_RECURSE files RELATIVE ${DIRECTORY} ${DIRECTORY}/*.cl ${DIRECTORY}/*.h)
list(SORT files)
set(chunk 12000)
set(table "")
foreach(file IN LISTS files)
  file(READ ${DIRECTORY}/${file} text)
  string(LENGTH "${text}" length)
  string(APPEND table "    {\"${file}\",\n     std::string()")
  set(begin 0)
  while(begin LESS length)
    string(SUBSTRING "${text}" ${begin} ${chunk} part)
    string(APPEND table "\n         .append(R\"~~~~(${part})~~~~\")")
    math(EXPR begin "${begin} + ${chunk}")
  endwhile()
  string(APPEND table "},\n")
endforeach()
file(WRITE ${OUTPUT}.tmp
     "// Generated from cl/ by GenerateKernelSources.cmake.\n#include \"device/kernel_sources.hpp\"\n\nnamespace raysplats {\n\nconst std::map<std::string, std::string>& kernel_sources() {\n  static const std::map<std::string, std::string> sources{\n${table}  };\n  return sources;\n}\n\n}  // namespace raysplats\n"
)
file(RENAME ${OUTPUT}.tmp ${OUTPUT})
