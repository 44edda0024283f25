# Takes links to files that are not installed off the installed documents; their texts stay. Usage:
# cmake -DSHARE=FOLDER -P InstallDocuments.cmake
set(not_installed "apps|base|bench|dataset|drivers|emulator|estimator|plot|rehearsal|renderer|tests|tracking")
file(GLOB_RECURSE documents ${SHARE}/*.md)
foreach(document ${documents})
  file(READ ${document} text)
  string(REGEX REPLACE "\\[([^]]*)\\]\\((\\.\\./)*(${not_installed})(/[^)]*)?\\)" "\\1" plain "${text}")
  if(NOT plain STREQUAL text)
    file(WRITE ${document} "${plain}")
  endif()
endforeach()
