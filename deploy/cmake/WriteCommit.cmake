# Writes the commit of the folder SOURCE as a C string to the file OUTPUT; empty if it is not a checkout.
execute_process(COMMAND git -C ${SOURCE} describe --always --dirty --abbrev=12 --match=NeverMatch
                OUTPUT_VARIABLE commit ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
set(text "\"${commit}\"\n")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} old)
endif()
if(NOT "${old}" STREQUAL "${text}")
  file(WRITE ${OUTPUT} "${text}")
endif()
