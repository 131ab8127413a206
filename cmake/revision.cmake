# SPDX-License-Identifier: BSD-3-Clause
# cmake -DSOURCE=... -DOUTPUT=... -P revision.cmake: a header with what the sources are, written only if that has
# changed: the commit of a git checkout, what `git archive` put into revision.txt, or "unknown".
set(revision "unknown")
file(READ ${SOURCE}/cmake/revision.txt exported)
string(STRIP "${exported}" exported)
if(NOT exported MATCHES "Format:")
  set(revision "${exported} (archive)")
elseif(EXISTS ${SOURCE}/.git)
  find_program(GIT git)
  if(GIT)
    execute_process(COMMAND ${GIT} -C ${SOURCE} describe --always --abbrev=12 "--dirty= with changes"
                    OUTPUT_VARIABLE described ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(described)
      set(revision "${described}")
    endif()
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define HOLBA_REVISION \"${revision}\"\n" @ONLY)
