# SPDX-License-Identifier: BSD-3-Clause
# cmake -DHOLBA=program -DOUTPUT=folder -P program_docs.cmake: completion for shells and manual pages, from the program
# itself, in the folders that they are installed to below share.
function(write path)
  execute_process(COMMAND ${HOLBA} ${ARGN} OUTPUT_VARIABLE text RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "'${HOLBA} ${ARGN}' failed (${status})")
  endif()
  # Through the arguments of a function semicolons would be lost.
  file(WRITE ${OUTPUT}/${path} "${text}")
endfunction()
file(REMOVE_RECURSE ${OUTPUT})
write(bash-completion/completions/holba completion bash)
write(zsh/site-functions/_holba completion zsh)
write(fish/vendor_completions.d/holba.fish completion fish)
write(man/man1/holba.1 man)
execute_process(COMMAND ${HOLBA} help OUTPUT_VARIABLE help)
string(REGEX MATCHALL "\n  [a-z_]+ " commands "${help}")
foreach(command ${commands})
  string(STRIP "${command}" command)
  write(man/man1/holba-${command}.1 man ${command})
endforeach()
