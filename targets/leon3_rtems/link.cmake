# SPDX-License-Identifier: Apache-2.0
# One link: the app is linked with the core, so nothing is loaded that would need a table of the core's symbols.
set(CMAKE_C_LINK_EXECUTABLE "<CMAKE_C_COMPILER> ${RTEMS_SYS_SPECS_FLAGS} ${RTEMS_BSP_C_FLAGS} <FLAGS> -u Init \
-o <TARGET> <OBJECTS> ${CMAKE_CURRENT_LIST_DIR}/files.o <LINK_LIBRARIES> -Wl,--gc-sections,--defsym=leon3_registers=0")
