# romap_embed_files(target symbol folder [DEPENDS files...]): a static library with the files below a folder, which are
# read when it is built. The assembler copies them (.incbin), because compilers are slow with large arrays. `symbol`: the
# name of the function that returns them, declared as `std::span<const Asset> symbol();` in namespace romap::http. An
# empty `folder` gives an empty table.
#
# As a script (cmake -P), writes the source of such a library: -DFOLDER= -DSYMBOL= -DOUT= [-DGZIP=program].

if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  cmake_minimum_required(VERSION 3.25)
  # | stands for a semicolon, which separates the elements of a list.
  set(types "html=text/html|charset=utf-8" "js=text/javascript|charset=utf-8" "mjs=text/javascript|charset=utf-8"
      "css=text/css|charset=utf-8" "json=application/json" "svg=image/svg+xml" "png=image/png" "jpg=image/jpeg"
      "ico=image/x-icon" "wasm=application/wasm" "txt=text/plain|charset=utf-8" "woff2=font/woff2"
      "webmanifest=application/manifest+json")
  set(compressed html js mjs css json svg wasm txt webmanifest ico)
  set(blobs "")
  set(entries "")
  set(count 0)
  set(files "")
  if(FOLDER)
    if(NOT IS_DIRECTORY "${FOLDER}")
      message(FATAL_ERROR "${FOLDER}: there is no such folder")
    endif()
    file(GLOB_RECURSE files RELATIVE "${FOLDER}" "${FOLDER}/*")
  endif()

  # embed(name path): adds the bytes of a file as the symbols `name` and `name`_end.
  function(embed name path)
    file(SHA256 "${path}" hash)  # a changed file changes the source, so that it is compiled again
    set(blobs "${blobs}// ${hash}
__asm__(\".pushsection .rodata\\n.balign 16\\n${name}:\\n.incbin \\\"${path}\\\"\\n${name}_end:\\n.byte 0\\n.popsection\\n\");
extern \"C\" const char ${name}[] __attribute__((visibility(\"hidden\")));
extern \"C\" const char ${name}_end[] __attribute__((visibility(\"hidden\")));
" PARENT_SCOPE)
  endfunction()

  get_filename_component(out_folder "${OUT}" DIRECTORY)
  foreach(file IN LISTS files)
    set(type "application/octet-stream")
    string(REGEX MATCH "[^.]*$" extension "${file}")
    foreach(pair IN LISTS types)
      if(pair MATCHES "^${extension}=(.*)$")
        string(REPLACE "|" "; " type "${CMAKE_MATCH_1}")
      endif()
    endforeach()
    set(name "${SYMBOL}_${count}")
    embed(${name} "${FOLDER}/${file}")
    set(gzip "{}")
    if(GZIP AND extension IN_LIST compressed)
      set(packed "${out_folder}/${SYMBOL}_${count}.gz")
      execute_process(COMMAND "${GZIP}" -9 -n -c "${FOLDER}/${file}" OUTPUT_FILE "${packed}" COMMAND_ERROR_IS_FATAL ANY)
      file(SIZE "${FOLDER}/${file}" size)
      file(SIZE "${packed}" packed_size)
      if(packed_size LESS size)
        embed(${name}_gz "${packed}")
        set(gzip "Bytes(${name}_gz, ${name}_gz_end)")
      endif()
    endif()
    string(APPEND entries "      {.path = \"${file}\", .content_type = \"${type}\", .data = Bytes(${name}, ${name}_end), .gzip = ${gzip}},\n")
    math(EXPR count "${count} + 1")
  endforeach()

  set(source "// Written by EmbedFiles.cmake.\n#include <vector>\n\n#include \"server/http/assets.h\"\n\n${blobs}
namespace romap::http {

[[maybe_unused]] static std::string_view Bytes(const char* begin, const char* end) {
  return {begin, static_cast<size_t>(end - begin)};
}

std::span<const Asset> ${SYMBOL}();
std::span<const Asset> ${SYMBOL}() {
  static const std::vector<Asset> kAssets = {
${entries}  };
  return kAssets;
}

}  // namespace romap::http
")
  file(CONFIGURE OUTPUT "${OUT}" CONTENT "${source}" @ONLY)
  return()
endif()

set(ROMAP_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_FILE})
find_program(ROMAP_GZIP gzip)

function(romap_embed_files target symbol folder)
  cmake_parse_arguments(ARG "" "" "DEPENDS" ${ARGN})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/${target}/${symbol}.cc)
  file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/${target})
  add_custom_command(
    OUTPUT ${out}
    COMMAND ${CMAKE_COMMAND} -DFOLDER=${folder} -DSYMBOL=${symbol} -DOUT=${out} $<$<BOOL:${ROMAP_GZIP}>:-DGZIP=${ROMAP_GZIP}>
            -P ${ROMAP_EMBED_SCRIPT}
    COMMAND ${CMAKE_COMMAND} -E touch ${out}
    DEPENDS ${ROMAP_EMBED_SCRIPT} ${ARG_DEPENDS}
    COMMENT "Embedding the files of ${folder}"
    COMMAND_EXPAND_LISTS VERBATIM)
  add_library(${target} STATIC ${out})
  target_include_directories(${target} PRIVATE ${CMAKE_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE absl::status)
endfunction()

# The library romap_viewer_assets with the function ViewerAssets(). client/viewer defines the target romap_viewer_dist,
# which builds the page, with the properties ROMAP_VIEWER_DIST_DIR (the folder) and, optionally, ROMAP_VIEWER_DIST_STAMP
# (a file that changes with it). Without this target, the table is empty. Call it after all folders.
function(romap_add_viewer_assets)
  if(NOT TARGET romap_viewer_dist)
    romap_embed_files(romap_viewer_assets ViewerAssets "")
    return()
  endif()
  get_target_property(folder romap_viewer_dist ROMAP_VIEWER_DIST_DIR)
  if(NOT folder)
    message(FATAL_ERROR "the target romap_viewer_dist has no property ROMAP_VIEWER_DIST_DIR")
  endif()
  get_target_property(stamp romap_viewer_dist ROMAP_VIEWER_DIST_STAMP)
  if(NOT stamp)
    set(stamp "")
  endif()
  romap_embed_files(romap_viewer_assets ViewerAssets ${folder} DEPENDS romap_viewer_dist ${stamp})
endfunction()
