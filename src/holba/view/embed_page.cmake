# SPDX-License-Identifier: BSD-3-Clause
# Writes the C++ file OUTPUT with the bytes of PAGE, which is ASCII, as raw string literals of a size that compilers take.
file(READ ${PAGE} page)
if(page MATCHES "\\)page\"")
  message(FATAL_ERROR "${PAGE} holds the end of the literal that it is put into.")
endif()
string(LENGTH "${page}" length)
set(pieces "")
set(at 0)
while(at LESS length)
  string(SUBSTRING "${page}" ${at} 16000 piece)
  string(APPEND pieces "    R\"page(${piece})page\"\n")
  math(EXPR at "${at} + 16000")
endwhile()
file(WRITE ${OUTPUT} "// Made of ${PAGE} by embed_page.cmake.
#include \"holba/view/viewer_page.h\"
namespace holba {
std::string_view ViewerPage() {
  static constexpr char kPage[] =
${pieces}    ;
  return {kPage, sizeof(kPage) - 1};
}
}  // namespace holba
")
