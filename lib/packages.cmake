# Packages for Debian, made by CPack: `cmake --preset packages`, then `ninja -C build/packages package`. Each install() of the tree
# names its component, and each component is a package.
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SOURCE forceserver)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
# Whoever makes the packages answers for them. Other tools of Debian read these variables of the environment, too.
if(DEFINED ENV{DEBEMAIL} AND DEFINED ENV{DEBFULLNAME})
  set(CPACK_PACKAGE_CONTACT "$ENV{DEBFULLNAME} <$ENV{DEBEMAIL}>")
else()
  set(CPACK_PACKAGE_CONTACT "The authors of forceserver <forceserver@forceserver.invalid>")
endif()

# dpkg-shlibdeps finds which packages a package needs by what its files are linked with. The library itself belongs to no package
# yet: it is found in the build folder, and CPack writes that all need the package of the same version.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR})
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS ON)

set(work ${PROJECT_BINARY_DIR}/packages)
# Man pages are compressed; folders are for all to read, whatever the umask of who makes the packages.
file(WRITE ${work}/finish.cmake "execute_process(WORKING_DIRECTORY \${CPACK_TEMPORARY_DIRECTORY} COMMAND_ERROR_IS_FATAL ANY
  COMMAND sh -c \"find . -path '*/share/man/*' -type f -exec gzip -9n {} + && chmod -R u=rwX,go=rX .\")\n")
set(CPACK_PRE_BUILD_SCRIPTS ${work}/finish.cmake)
string(TIMESTAMP year "%Y" UTC)
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # of SOURCE_DATE_EPOCH, if the environment has it
file(WRITE ${work}/changelog "forceserver (${PROJECT_VERSION}) stable; urgency=medium

  * Version ${PROJECT_VERSION}.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
execute_process(COMMAND gzip -9nf ${work}/changelog COMMAND_ERROR_IS_FATAL ANY)

# package(component name section summary description [library...]): library: a package of Debian that has only headers, so parts
# of it are in the binaries. (Boost has only headers, too, but its licence asks for nothing where there is no source.)
set(CPACK_COMPONENTS_ALL)
function(package component name section summary description)
  set(copyright "forceserver\n\nCopyright (C) ${year} the authors of forceserver\nLicence: Apache License, version 2.0; \
on Debian it is in /usr/share/common-licenses/Apache-2.0.\n")
  foreach(library IN LISTS ARGN)
    if(NOT EXISTS /usr/share/doc/${library}/copyright)
      message(FATAL_ERROR "/usr/share/doc/${library}/copyright is missing: package ${name} has parts of ${library}, so it needs this licence")
    endif()
    file(READ /usr/share/doc/${library}/copyright text)
    string(APPEND copyright "\n\nParts of ${library} are in this package. Debian says of it:\n\n${text}")
  endforeach()
  file(WRITE ${work}/${name}/copyright "${copyright}")
  install(FILES ${work}/${name}/copyright ${work}/changelog.gz DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name}
    COMPONENT ${component})

  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
  string(TOUPPER ${component} component)
  set(CPACK_DEBIAN_${component}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${component}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${component}_DESCRIPTION "${summary}
forceserver is a haptics library. An application says what is to be felt:
a wall, a spring, a guide along a path. A real-time servo evaluates these
force-objects where the hand is, a thousand times a second and more.

${description}" PARENT_SCOPE)
  if(NOT component STREQUAL LIBRARY)
    set(CPACK_COMPONENT_${component}_DEPENDS library PARENT_SCOPE)
  endif()
endfunction()

get_target_property(soversion forceserver SOVERSION)
set(library libforceserver${soversion})
package(library ${library} libs "haptics: library and drivers of devices"
  "This package has the library, and the drivers of haptic devices, which it\nloads when they are first used." nlohmann-json3-dev)
package(development libforceserver-dev libdevel "haptics: headers for C and C++"
  "This package has the headers, the CMake package, the pkg-config file and the\nJSON schema of scene files.")
if(TARGET forceserver_program)
  package(program forceserver science "haptics: server of a device, and tools for scenes"
    "This package has the program that serves a device to several applications, and
records, checks and watches scenes; the rules that let users open devices on
the USB; and a controller that stands for the device FIDEL." nlohmann-json3-dev libcli11-dev)
endif()
if(TARGET forceserver_bridge)
  package(dds forceserver-dds science "haptics: bridge between machines over DDS"
    "This package has the program that joins the servers of several machines, and\nthe one that makes the keys for it."
    libcli11-dev)
  set(CPACK_DEBIAN_DDS_PACKAGE_RECOMMENDS openssl)  # make-keys
endif()

set(CPACK_DEBIAN_LIBRARY_PACKAGE_SUGGESTS forceserver)  # the rules for devices on the USB
# Packages of programs that were built with this version need it or a later one.
file(WRITE ${work}/shlibs "libforceserver ${soversion} ${library} (>= ${PROJECT_VERSION})\n")
# The loader's cache is made anew.
file(WRITE ${work}/triggers "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${work}/shlibs ${work}/triggers)
include(CPack)
